"""The model of a campaign: a pure function of its cell and its state."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from planner.campaign.cell import Cell
from planner.campaign.frf_model import ErrorByZone, local_size
from planner.campaign.hit_errors import CampaignHitErrors, HitErrorEstimate, systematic_errors
from planner.campaign.labels import LabelledPose, observations
from planner.campaign.low_fidelity import FEW_POSES, LowFidelity
from planner.campaign.proposals import acquisition_inputs, poses_at, uncertain_parameters
from planner.campaign.state import Measurement
from planner.design.acquisitions import mixed, parameter_variance, repeat_gain
from planner.design.frequency_posterior import FrequencyOutputs, Poses
from planner.design.parameter_sensitivity import FrfNoise
from planner.design.stopping import Forecast, forecast
from planner.dynamics.at_force import with_possible_laws
from planner.dynamics.simulation import Simulation
from planner.dynamics.vibration import SimulatedModes
from planner.frf.frf import Frf
from planner.robot.place_names import place_names, with_names
from planner.surrogate.frequency_models import Predicting
from planner.surrogate.frf_bands import ModalPrediction, frf_moments
from planner.surrogate.modal_surrogate import ModalObservations, Surrogate
from planner.words import counted, listed

if TYPE_CHECKING:
    from planner.campaign.decision import Decision

CONSIDERED = 500  # candidates, the first ones, when asking what one more measurement would gain


@dataclass(frozen=True, eq=False)
class Model:
    """What is believed after the measurements of one state."""

    cell: Cell
    labelled: tuple[LabelledPose, ...]
    low: LowFidelity
    seen: ModalObservations
    surrogate: Surrogate  # of frequencies and damping
    frf_noise: FrfNoise | None = None  # None: no FRF was looked at
    estimated: CampaignHitErrors | None = None  # None: nothing tells errors of hits
    used: tuple[Measurement, ...] = ()  # of the labelled poses, as they were measured
    frfs: tuple[Frf, ...] = ()  # of their tools, in the band of campaign.toml

    def predict(self, q: np.ndarray) -> ModalPrediction:
        """Frequencies and damping at poses q (n, dof) in rad, as a visit there would show them.

        The modal analysis' own sd of what it will measure there is not part of the sds.
        """
        return self._predict(q, self.cell.features(q), self.low.simulate(q))

    def frequencies(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frequencies and their sds (n, count) in Hz, as of `predict`."""
        said = self.low.frequencies(q)
        f, sd = self.surrogate.frequencies(self.cell.features(q), said.frequency_hz)
        return f, self._with_parameters(q, said, f, sd)

    def _with_parameters(
        self, q: np.ndarray, simulated: SimulatedModes, f: np.ndarray, sd: np.ndarray
    ) -> np.ndarray:
        """Sds (n, count) with what the simulation's own parameters leave open, all in Hz."""
        share = self.surrogate.frequency_trust * self.low.frequency_sd(q, simulated)
        return np.hypot(sd, share * f)

    @cached_property
    def hit_errors(self) -> dict[str, tuple[HitErrorEstimate, ...]]:
        """Of the hits of each pose, where a simulation tells them."""
        return self.estimated.poses if self.estimated else {}

    @property
    def systematic_hit_errors(self) -> tuple[str, ...]:
        """What all hits have in common, in words; of one pose nothing, for there what the
        simulation lacks may look like hits that tilt."""
        poses = self.hit_errors.values()
        return systematic_errors([hit for own in poses for hit in own]) if len(poses) > 1 else ()

    @cached_property
    def seen_exactly(self) -> ModalObservations:
        """`seen` with residues as hits without a miss would give them, which FRFs alone need."""
        if self.estimated is None:
            return self.seen
        both = zip(self.labelled, self.used, strict=True)
        exact = tuple(self.estimated.corrected(pose, measured) for pose, measured in both)
        return observations(self.cell, exact)

    @cached_property
    def with_residues(self) -> Surrogate:
        """The surrogate of residues too, which FRFs alone need: fitted when asked for."""
        return self.surrogate.with_residues(self.seen_exactly)

    @cached_property
    def workspace_prediction(self) -> ModalPrediction:
        """Modes at the candidate poses, which stand for the workspace; means over visits.

        Their sds leave out the scatter from visit to visit, which no further pose lowers.
        """
        candidates = self.cell.candidates
        said = self.simulated_candidates
        return self._predict(candidates.q, candidates.features, said, visit=False)

    @cached_property
    def simulated_candidates(self) -> SimulatedModes:
        """What the low fidelity says at the candidates; without residues."""
        return self.low.frequencies(self.cell.candidates.q)

    @cached_property
    def acquisition_inputs(self) -> tuple[FrequencyOutputs, Poses]:
        """The posterior as acquisitions see it, and the candidates."""
        return acquisition_inputs(self, informed=False)

    @cached_property
    def informed(self) -> tuple[FrequencyOutputs, Poses]:
        """The same with what `informed_candidates` would tell of the simulation's parameters."""
        return acquisition_inputs(self, informed=True)

    @cached_property
    def decision(self) -> "Decision | None":
        """Whether the cut of campaign.toml is stable, pose by pose; None where none is named."""
        from planner.campaign.decision import cut_decision

        return cut_decision(self)

    @cached_property
    def deciding(self) -> tuple[FrequencyOutputs, Poses]:
        """As `informed`, asked for the margins of the decision about the cut."""
        from planner.campaign.decision import deciding_outputs

        outputs, poses = self.informed
        return deciding_outputs(self, outputs), poses

    @cached_property
    def forecast(self) -> Forecast:
        """Predicted RMSE over the workspace, and what one more measurement would gain."""
        outputs, best, stop = self.acquisition_inputs[0], self._best, self.cell.config.stop
        fit, least = self.low.identified_robot, 0.0
        if fit is not None and fit.wider is not None:
            least = float(np.mean((self.frequency_sd_percent / 100) ** 2))
        found = forecast(outputs, best, stop.frequency_sd_percent, stop.probability, least)
        misses = self.low.misfit_sds
        return found.doubted(misses) if misses and found.measurements < FEW_POSES else found

    @cached_property
    def _best(self) -> Poses:
        """The candidate (n = 1) that gains most, with what hits there tell of the simulation."""
        outputs, poses = self.acquisition_inputs
        index = int(np.argmax(mixed(outputs, poses[:CONSIDERED])))
        return self._told_by(poses[[index]], self.cell.candidates.q[index : index + 1])

    def _told_by(self, poses: Poses, q: np.ndarray) -> Poses:
        """The poses with what hits there, q (n, dof) in rad, tell of the simulation."""
        open_ = uncertain_parameters(self)
        return poses if open_ is None else replace(poses, information=open_.information(q))

    @property
    def done(self) -> bool:
        """Whether the target is reached with the probability that campaign.toml asks for.

        That is the decision about the cut where acquisition "stability" asks for it.
        """
        return not self.waits_for

    @property
    def waits_for(self) -> str:
        """What lacks until the target is reached; "": it is."""
        stop, decision = self.cell.config.stop, self.cell.config.acquisition.name == "stability"
        lacking, sure = stop.measurements_min - len(self.labelled), 100 * stop.probability
        what = "decision about the cut" if decision else "error below the target"
        waits = [] if self._sure else [f"{what} with {sure:g} % probability"]
        if lacking > 0:
            more = counted(lacking, "more pose")
            waits.append(f"{more}, as {stop.measurements_min} are the least (measurements_min)")
        return " and ".join(waits)

    @property
    def _sure(self) -> bool:
        stop = self.cell.config.stop
        if self.cell.config.acquisition.name == "stability":
            return self.decision is not None and self.decision.sure(stop.probability)
        return self.forecast.reached >= stop.probability

    def repeat(self) -> dict[str, Any] | None:
        """The measured pose that gains most from more hits; None where a new pose gains more.

        Gains are reductions of the mean relative variance.
        """
        if not self.labelled:
            return None
        outputs, q = self.acquisition_inputs[0], np.array([pose.q for pose in self.labelled])
        sd = [[m.frequency_sd_hz / m.frequency_hz if m else np.nan for m in p.modes]
              for p in self.labelled]  # fmt: skip
        there = self._told_by(poses_at(self, q)[0], q)
        gain = repeat_gain(outputs, np.array(sd) ** 2) + parameter_variance(outputs, there)
        best, new = int(np.argmax(gain)), float(mixed(outputs, self._best)[0])
        if gain[best] <= new:
            return None
        pose = self.labelled[best].pose
        text = f"First hit {pose} again, as often as before: that tells more than a new pose."
        gained = float(gain[best])
        return {"pose": pose, "gain": gained, "gain_of_a_new_pose": new, "text": text}

    def _predict(
        self,
        q: np.ndarray,
        features: np.ndarray,
        simulated: SimulatedModes,
        surrogate: Surrogate | None = None,
        visit: bool = True,
    ) -> ModalPrediction:
        """The surrogate's prediction, with what the simulation's own parameters leave open."""
        found = (surrogate or self.surrogate).predict(features, simulated, visit)
        sd = self._with_parameters(q, simulated, found.frequency_hz, found.frequency_sd_hz)
        return replace(found, frequency_sd_hz=sd)

    def frf(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean (n, 3, 3, F), complex, and sd (n, 3, 3, F) of the accelerance in m/s²/N.

        sd is the root of E|H − mean|².
        """
        fit = self.low.identified_robot
        if self.frfs and fit is not None and fit.fits:
            return fit.predicted(q, frequency_hz)
        mean, sd = self._modal_frf(q, frequency_hz)
        if not self.frfs:
            return mean, sd
        return mean, np.hypot(sd, self.frf_error.at(frequency_hz) * local_size(mean, frequency_hz))

    @cached_property
    def frf_error(self) -> ErrorByZone:
        """Of FRFs of the fused modes, beyond their sds. Worked out when asked for."""
        return ErrorByZone.of(self)

    @property
    def knows_frfs(self) -> bool:
        """Whether what FRFs of the fused modes take was worked out already."""
        return "with_residues" in vars(self)

    @property
    def struck(self) -> Simulation | None:
        """The simulation whose laws say what another force changes; None: nothing does.

        Springs have of the laws what robot.toml says: hits they were identified from, too.
        """
        simulation = self.low.simulation
        if simulation is None or not simulation.robot.config.law:
            return None
        return with_possible_laws(simulation)

    def _modal_frf(self, q: np.ndarray, frequency_hz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """FRFs of the fused modes."""
        x, simulated = self.cell.features(q), self.low.simulate(q)
        return frf_moments(self._predict(q, x, simulated, self.with_residues), frequency_hz)

    @property
    def not_predicted(self) -> str:
        """What to say of modes that every pose shows and that are none of those predicted; ""."""
        others = []
        for pose, measured in zip(self.labelled, self.used, strict=True):
            given = {mode.frequency_hz for mode in pose.modes if mode is not None}
            every = [m.frequency_hz for m in measured.modes if m.likely]
            others.append([hz for hz in every if hz not in given])
        if not others or not all(others):
            return ""
        hz, count = [f for own in others for f in own], self.cell.config.modes.count
        return (
            f"This holds for {counted(count, 'mode')}; every pose shows more, which are not "
            f"counted (between {min(hz):.1f} and {max(hz):.1f} Hz). Where they matter, raise "
            f"count in [modes] of campaign.toml."
        )

    @property
    def never_found(self) -> str:
        """What to say of modes that the simulation expects and that no pose has shown; ""."""
        highest = self.cell.config.modes.band_hz[1]
        missing = []
        for k in range(self.surrogate.count):
            hz = [pose.simulated_hz[k] for pose in self.labelled if pose.modes[k] is None]
            if len(hz) == len(self.labelled) > 0 and np.median(hz) < highest:
                missing.append(f"mode {k + 1} (about {np.median(hz):.1f} Hz)")
        if not missing:
            return ""
        return (
            f"No pose has shown {listed(missing)}, which the simulation expects: where one does "
            f"not exist, the modes above it are numbered one too high."
        )

    @property
    def cautions(self) -> tuple[str, ...]:
        """What who uses predictions must know before."""
        caution = with_names(self.low.caution, place_names(self.cell.robot))
        return tuple(filter(None, (caution, self.never_found)))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the engineer should know of the model: doubts about the simulation."""
        low = with_names(self.low.remark, place_names(self.cell.robot))
        found = [low] if low else []
        found += filter(None, (self.never_found, *self.surrogate.remarks))
        if isinstance(self.surrogate.primary, Predicting):
            found.append(
                f"The model {self.cell.config.surrogate.model} does not say how poses go together: "
                f"proposals, forecasts and the test of poses left out are those of ar1; planner "
                f"status --models tests it itself."
            )
        if self.labelled and self.low.simulation is not None:
            left = [str(k + 1) for k, w in enumerate(self.surrogate.frequency_trust) if w < 0.5]
            if left:
                found.append(
                    f"The simulation disagrees with the measurements of mode {', '.join(left)}: "
                    f"predicted without it."
                )
        if len(self.labelled) >= FEW_POSES:
            percent = 100 * float(np.sqrt(np.mean(self.surrogate.visit_scatter**2)))
            if percent > 0.3:  # larger than usual
                check = "Check temperature, clamping and readback."
                axes = frozenset().union(*(m.axes for m in self.used))
                partly = [
                    f"{m.pose} along {listed(sorted(axes - m.axes))}"
                    for m in self.used
                    if m.axes and m.axes < axes
                ]
                if partly:
                    check = f"No hits yet at {'; '.join(partly)}: hit there, too."
                found.append(
                    f"Frequencies scatter by {percent:.1g} % (sd) from visit to visit, more than "
                    f"the modal analysis states: predicted sds include it, further poses do not "
                    f"lower it. {check}"
                )
        return tuple(found)

    @cached_property
    def frf_sd_percent(self) -> tuple[float, ...]:
        """Sd of predicted FRFs over the workspace in %, and of their common scale; () not known."""
        fit = self.low.identified_robot
        if fit is None or not fit.fits:
            return ()
        return fit.frf_sd_percent(self.cell.candidates.q[:FEW_POSES])

    @cached_property
    def frequency_sd_percent(self) -> np.ndarray:
        """Predicted sd of each natural frequency, root mean square over the workspace, in %."""
        found = self.workspace_prediction
        return 100 * np.sqrt(np.mean((found.frequency_sd_hz / found.frequency_hz) ** 2, axis=0))
