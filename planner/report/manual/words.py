"""Chapters of the manual that are words: tutorial, recordings, what numbers mean."""

from planner.report.page.html import Markup, bullets, joined, paragraphs, section, tag, words_table

TUTORIAL = (
    (
        "Begin with files that run.",
        "planner new --example cell7-robot",
        "Files with comments: robot/robot.toml, robot/robot.urdf and campaign.toml; cut.toml and "
        "tool.toml are for planner stability and couple. Replace "
        "the URDF by your robot's (makers publish them, ROS packages hold many), keep two links on "
        "fixed joints: where the hammer hits and where the accelerometer sits. A link that moves "
        "needs an <inertial>; boxes or cylinders as <collision> are enough.",
    ),
    (
        "State what gives way.",
        "planner schema robot",
        "One [[compliance]] for each elastic rotation, at least one about each gear's axis. "
        "Starting values may be off by a factor of two. For a robot of 6 axes that carries 200 kg "
        "joint stiffnesses are 1e6 to 1e7 N·m/rad, for one that carries 10 kg 1e4 to 1e5. A joint "
        "that slides (prismatic: a rail, a gantry) gives along its axis: stiffness_n_m in N/m and "
        "damping_n_s_m.",
    ),
    (
        "Check it.",
        "planner check cell7-robot/robot/robot.toml --campaign cell7-robot/campaign.toml "
        "--plot pictures",
        "What looks wrong is said with a remedy: units, limits in degrees, links without inertia, "
        "a band beside the modes. Look at the picture: do the joint axes point where they should?",
    ),
    (
        "Start the campaign and ask where to hit.",
        "planner new cell7 --robot cell7-robot/robot/robot.toml --campaign "
        "cell7-robot/campaign.toml\nplanner next cell7\nplanner export cell7 krl",
        "The pose comes as joint angles, as a place of the tool, and as a program for the "
        "controller. Only poses are checked for collision, not the ways between them.",
    ),
    (
        "Hit, import, repeat.",
        "planner watch cell7 exports/\nplanner import cell7 exports/P001     # or by hand",
        "Some hits along each axis of the tool frame; four an axis tell outliers. Hits that cannot "
        "be trusted are refused with a reason and kept.",
    ),
    (
        "Hand it on.",
        "planner report cell7\nplanner export cell7 uff --out handed_on\n"
        "planner predict cell7 poses.csv",
        "The report is one file. Everything in it can be computed again from the campaign's "
        "folder: planner replay cell7.",
    ),
)

ANGLES = "joint_1_deg,joint_2_deg,joint_3_deg,joint_4_deg,joint_5_deg,joint_6_deg"

RECORDINGS_CSV = f"""pose,{ANGLES},hit,repeat,file
P001,-7.120,9.867,-29.147,-8.117,55.299,0.000,+x,1,data/P001_x_1.uff
P001,-7.120,9.867,-29.147,-8.117,55.299,0.000,+y,1,data/P001_y_1.uff
P001,-7.120,9.867,-29.147,-8.117,55.299,0.000,-z,1,data/P001_z_1.uff"""

ASK_TELL = """from planner import AskTell

loop = AskTell("robot/robot.toml", "campaign.toml")     # or its tables as a dict
proposal = loop.ask()[0]
loop.tell(proposal.joints_deg, frf=frf)     # planner.frf.frf.Frf; or modes=[{"frequency_hz": …}]
loop.predict([[0, 10, -30, 0, 50, 0]])      # degrees"""

POSES_CSV = f"""pose,{ANGLES}
milling_1,-7,10,-29,-8,55,0"""

NAMED_COLUMNS = """time_s,force_n,acceleration_x_m_s2,acceleration_y_m_s2,acceleration_z_m_s2
0.0000,0.4,0.01,-0.02,0.00
0.0005,812.7,1.93,-0.41,0.22"""

FORMATS = (
    ("UFF 58, 58b", "one hit as time histories: force (ordinate type 13, N) and acceleration "
     "(type 12, m/s²) with rsp_dir 1, 2, 3 for x, y, z of the sensor and ref_dir for the hit; or "
     "FRFs (function type 4), with or without coherence (type 6)"),
    ("CSV, MAT, HDF5, TDMS", "columns or arrays named time_s, force_n, acceleration_x_m_s2, …; for "
     "FRFs frequency_hz, accelerance_xx, …; the hit as attribute hit = +x, in a CSV as its first "
     "line: # hit: +x; or else in recordings.csv"),
    ("text of spreadsheets and analysers", "columns parted by comma, semicolon, tab or blanks, "
     "decimals with point or comma, UTF-8, UTF-16 or Latin; names such as Time (s), Force [N], "
     "Acc X (g), t/s, or units in the line below; one column of times, or one for each channel"),
    ("FRFs as text", "Frequency (Hz) with Real and Imag, or Magnitude (also in dB) and Phase (deg "
     "or rad), their unit such as (m/s²)/N or m/N in the name or below it, Coherence; where they "
     "were felt and hit as lines # response: +y and # hit: +x before the names, as columns "
     "response and hit of recordings.csv, or with --from-names from the file's name: tap_yx "
     "(response y, hit x), H3_1 (nodes). A file that holds several hits, or all FRFs, of a pose "
     "may have a row for each hit"),
    ("MAT, HDF5, TDMS, LVM", "as programs write them: structs, cell arrays and groups, also one a "
     "hit; a matrix with a list of names beside it; unit, rate (fs, dt, wf_increment, …) and start "
     "(t0, wf_start_time, …) of each channel; LabVIEW's .lvm with one or many x columns. Channels "
     "that begin apart are laid over each other; what is no signal is left out"),
    ("WAV", "of 16, 24 or 32 bits or floating-point; what its samples stand for is said in "
     "channels.csv beside it: columns channel (from 1), name (force, acceleration x, …), unit and "
     "full_scale, what the largest sample stands for in that unit; where wanted file, hit and "
     "hit_point. Channels without a row are left out"),
    ("all of them", "a record may hold several hits, along one axis: it is cut by the pulses. Wait "
     "between two hits until the robot is at rest, and as long after the last"),
)  # fmt: skip

CHANNELS_CSV = """file,channel,name,unit,full_scale,hit
x.wav,1,force,N,2200,+x
x.wav,2,acceleration x,m/s^2,98.1,
x.wav,3,acceleration y,m/s^2,98.1,
x.wav,4,acceleration z,m/s^2,98.1,"""

NUMBERS = (
    ("frequency_sd_hz of a measured mode", "what noise and scatter of the hits leave open of "
     "that pole. The same pose hit again another day may differ by more: see scatter."),
    ("sd_hz of a prediction",
     "what a new visit to that pose would show, scatter from visit to "
     "visit included. Twice of it holds about 95 %."),
    ("sd over the workspace",
     "root mean square over the workspace, in %, without that scatter: what "
     "more poses can lower. By it the campaign stops."),
    ("RMSE and its probability",
     "error of the frequencies over the workspace as the model "
     "expects it of itself, corrected by how well it predicts each measured pose without it."),
    ("coverage",
     "share of measured frequencies inside intervals that claim 50, 80, 90, 95 %. With few "
     "poses it scatters: the grey band of the picture says by how much."),
    ("frf_sd", "root of E|H − mean|² in m/s²/N. Where the simulation explains the recordings it "
     "holds a scale common to all FRFs, which only the gains of sensor and hammer ([sensor] "
     "gain_sd_percent, force_gain_sd_percent: 1.5 % each unless a certificate says better) and the "
     "masses in the URDF tell; status says how large both are."),
    ("probability of a mode",
     "that the pole is a mode of the structure, from how it stands out "
     "of noise and comes back at other model orders."),
    ("probability of an effect",
     "among all candidates of a diagnosis, “unknown” included; they add "
     "up to 1. What cannot be told apart is named as a set."),
    ("FRAC, Frobenius", "agreement of FRFs over all lines, 1 for equal ones (Birk et al. 2025)."),
)  # fmt: skip

TRUST = (
    "Inside the workspace, after the target is reached and with honest coverage: frequencies as "
    "stated.",
    "Outside the workspace: not. The model extrapolates, and its sds do not know that.",
    "With fewer than four poses the coverage says little; look at the errors pose by pose.",
    "A simulation that lacks physics is noticed, and the model then trusts it less; planner "
    "diagnose says what is missing.",
    "Where all modes of a pose lie to one side of what was expected the robot may have drifted: "
    "import and session name the pose to hit again, which is proposed next, and say then whether "
    "it is as it was.",
    "Brakes on, one temperature, one payload: what was tested is what is known. A tool of another "
    "mass is another campaign.",
)


def tutorial() -> Markup:
    """From nothing to a report, step by step."""
    steps = []
    for number, (title, commands, text) in enumerate(TUTORIAL, 1):
        steps += [tag("h3", f"{number}. {title}"), tag("pre", commands), tag("p", text)]
    return section("From your robot to a report", *steps, id_="tutorial")


def recordings() -> Markup:
    """How recordings have to look."""
    text = (
        "A recordings folder has a table, recordings.csv, with one hit a row, and the files that "
        "it names. Joint angles are those read back from the controller, in degrees, one column "
        "for each joint of the URDF, named as the joint: joint_1_deg. Of a joint that slides it is "
        "the place in millimetres, in a column such as rail_mm; so it is in every list of joint "
        "values, and answers then say joint_units. To a campaign, a table without any such column "
        "is one of proposed poses, as proposed; tables may lie in subfolders. A hit "
        "is a signed axis of the tcp frame."
    )
    return section(
        "Recordings",
        tag("p", text),
        tag("pre", RECORDINGS_CSV),
        words_table(("format", "what a file holds"), FORMATS),
        tag("p", "A file with named columns:"),
        tag("pre", NAMED_COLUMNS),
        tag("p", "Beside WAV files, channels.csv:"),
        tag("pre", CHANNELS_CSV),
        tag("p", "Poses for predict and export:"),
        tag("pre", POSES_CSV),
        id_="recordings",
    )


def numbers() -> Markup:
    """What each number means, and how far to trust it."""
    return section(
        "What the numbers mean",
        words_table(("number", "meaning"), NUMBERS),
        tag("h3", "How far to trust them"),
        bullets(TRUST),
        id_="numbers",
    )


def folder() -> Markup:
    """What a campaign's folder holds."""
    rows = (
        ("campaign.toml", "what you decided; may be edited, the next command follows and logs it"),
        ("robot/", "robot.toml, URDF and the meshes that it names; may be edited too"),
        ("log.jsonl", "every act, one line each, checksummed, never changed; undo adds a line"),
        ("recordings/", "every raw file and every version of the robot by content hash"),
        ("predictions/, export/, report.html", "made from the above; may be deleted"),
    )
    text = "A campaign is a folder. Copy it to hand it on; kill any command at any moment."
    return section(
        "The campaign's folder", tag("p", text), words_table(("", "holds"), rows), id_="folder"
    )


def python() -> Markup:
    """The same from scripts."""
    code = """import numpy as np
from planner import Campaign

campaign = Campaign.new("cell7", "robot/robot.toml", "campaign.toml")
for _ in range(10):
    proposal = campaign.next()[0]               # joint angles in degrees: proposal.joints_deg
    campaign.import_paths(["exports/" + proposal.pose])
    if campaign.model.done:
        break
modes = campaign.predict(np.deg2rad([[0, 10, -30, 0, 50, 0]]))    # q is in rad
"""
    return section(
        "From Python",
        joined((tag("pre", code), *paragraphs_of_python())),
        id_="python",
    )


def paragraphs_of_python() -> tuple[Markup, ...]:
    """Beside the code."""
    return (
        paragraphs(
            "Angles in names that end in _deg are degrees, in _rad (and q) radians; the places of "
            "joints that slide are millimetres there, metres in q (robot.joints converts). "
            "campaign.records() and predict_records(q) give rows that pandas.DataFrame takes.",
            "Where a script measures by itself and has modes or FRFs instead of files, AskTell "
            "proposes and learns in memory (degrees throughout, millimetres of slides):",
        ),
        tag("pre", ASK_TELL),
    )
