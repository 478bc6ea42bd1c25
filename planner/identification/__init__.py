"""The engine before `planner.fit`, which the diagnosis in `planner.diagnosis` still runs on."""
