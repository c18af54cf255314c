"""Every text of the page, in English; a translation replaces this module.

Names in braces are filled in by the page.
"""

from __future__ import annotations

# the page
TITLE = "flexdrive lab"
LEAD = "Two carts, one spring. Turn the gain and watch."
SKIP = "Skip to the controls"
DRIVE = "Drive"
BESIDE = "Beside it"
ALONE = "none"
COPY_LINK = "Copy link"
LINK_COPIED = "The address of this page with drive, controller and gain is on the clipboard."
THEME = "Light or dark"
LOCAL = "This page is served by your own machine; nothing leaves it."
REFUSED = "Left out of the address: {reasons}"
TAB_CONTROL = "Control"
TAB_PHYSICS = "Physics"
TAB_RECORDINGS = "Recordings"
TAB_GUIDE = "Lab 3, step by step"
TAB_EXERCISE = "Exercise"

# the rig
RIG = "The rig"
RIG_SUMMARY = "Animation of the carts on their track. Drag a cart and let go to strike it."
STRIPS_SUMMARY = "Positions x1, x2 and reference xr, and the command u, over time. Drag to choose an instant."
PLAY = "Play"
PAUSE = "Pause"
RESTART = "From the start"
SPEED = "Speed"
INSTANT = "Instant"
REAL_TIME = "real time"
STOPPED = "A cart left the track after {time}; the run was stopped, as the STOP button does."
PUSH_CART = "Strike cart {number}"
PUSH_HINT = "Drag a cart and let go to strike it."
CLEAR_PUSHES = "Take back all blows"
PUSHED = "{count} blows"
PUSHED_ONE = "1 blow"
MOST_PUSHED = "A run takes at most {most} blows; take them back first."

# control
CONTROLLER = "Controller"
FEEDBACK = "Fed back"
FEEDBACK_X2 = "x2, second cart"
FEEDBACK_X1 = "x1, motor cart"
GAIN = "Kp"
FACTOR = "Gain factor"
REFERENCE = "Reference"
REFERENCES = {
    "moves": "{stroke} forth and back (handout)",
    "one_move": "one move of {stroke}",
    "step": "step of {stroke}",
    "rest": "stand still",
}
AMPLITUDE = "Amplitude"
FREQUENCY = "Frequency"
LIMIT = "Command limit"
SAMPLE_TIME = "Sample time"
DELAY = "Input delay"
COUNT = "Encoder count"
RIG_SETTINGS = "Amplifier, sampling, encoders"
OWN_SETTINGS = "Back to the drive's own"
P_CONTROL = "P-control"
SQUARE = "Open loop: square"
SINE = "Open loop: sine"
AGENT = "Agent {name}"
OWN_CONTROLLER = "Own controller file"
CONTROLLERS = {
    "notch": "P with notch",
    "lead": "Notch and double lead",
    "integral": "Notch, lead and integral",
    "lab4": "Lab 4",
    "pd_x1": "PD from x1",
    "pd_shaped": "PD from x1, reference shaped",
    "cascade": "Cascade",
    "lab4_friction": "Lab 4, friction compensated",
    "cascade_friction": "Cascade, friction compensated",
    "lqg": "LQG from x2",
    "lqg_both": "LQG from x1 and x2",
    "h_infinity": "H∞ from x2",
}
DESIGNING = "Designing {name} for this drive …"
LOAD_CONTROLLER = "Controller or agent file (.toml, .npz)"
LOAD_CONTROLLER_REFUSED = "{name} was not read: {reason}"
LOADED_CONTROLLER = "{name} controls the rig now."

# charts of the loop
ROOT_LOCUS = "Root locus"
ROOT_LOCUS_SUMMARY = "Root locus; the rightmost pole has a real part of {real:.3g} rad/s."
REAL_AXIS, IMAGINARY_AXIS = "Re [rad/s]", "Im [rad/s]"
REAL_AXIS_PLAIN, IMAGINARY_AXIS_PLAIN = "Re L", "Im L"
POLES_NOW = "poles at your gain"
NYQUIST = "Nyquist"
NYQUIST_SUMMARY = "Nyquist plot of the loop gain; gain margin {gm:.3g}."
BODE_GAIN, BODE_PHASE = "Bode, gain", "Bode, phase"
DEGREES = "phase [°]"
GAIN_MARGIN = "gain margin ×{gm:.3g}"
PHASE_MARGIN = "phase margin {pm:.3g}°"
DESCRIBING_FUNCTION = "Limit over amplitude (describing function)"
AMPLITUDE_OF_X2 = "amplitude of x2 [{unit}]"
LIMIT_GAIN = "critical gain"
LIMIT_FACTOR = "critical factor"
LIMIT_CYCLE = "vibration keeps its size"
YOUR_GAIN = "your gain"
AMPLITUDE_SUMMARY = (
    "Describing-function limit over the amplitude of the vibration; its lowest value is {low:.3g} {unit}."
)
NO_AMPLITUDE_LIMIT = "no gain sustains a vibration"
NOT_LINEAR = "This controller is not linear: no root locus, Nyquist or Bode. Watch the motion."
OPEN_LOOP = "Nothing is fed back: the command is played."

# the lamp
LAMP_WORDS = {"stable": "Stable", "held": "At the limit", "unstable": "Unstable", "unknown": "–"}
STABLE = "Linear theory and simulation agree."
STABLE_ALWAYS = "No gain makes the linear loop unstable: its phase never reaches −180°."
STABLE_MARGIN = "The linear limit is {limit}, {times:.3g} times this gain"
STABLE_FACTOR = "Linear theory allows {times:.3g} times this gain"
STABLE_PHASE = "; the phase margin is {pm:.2g}°."
NEAR = "Stable, but near the limit."
HELD = "Linear theory calls this unstable above {limit}, but {friction} of Coulomb friction damps small vibrations."
HELD_PUSH = "One larger than {amplitude} grows: strike a cart and see."
HELD_ANY = "No vibration within the command limit grows."
UNSTABLE = "The vibration grows."
SWINGS = "Six seconds after the move the cart still swings {swing}."
LEAVES = "The cart leaves the track."
UNSTABLE_FACTOR = "Linear theory allows {times:.3g} times this gain."
HELD_FACTOR = (
    "Linear theory calls this unstable and allows {times:.3g} times this gain, but {friction} of Coulomb friction damps small "
    "vibrations."
)
UNSTABLE_LINEAR = "The linear limit is {limit}; friction lifts it, but not to this gain."
UNSTABLE_ALTHOUGH = (
    "Linear theory calls it stable: sampling, delay, limit or an effect that is switched on makes the difference."
)
WATCH = "Simulated alone: no linear theory is known of this controller."

# physics
PHYSICS_LEAD = "Switch an effect on. The charts show the force that a drive without it would miss: its signature."
EFFECT_OF = "{name} at {where}"
EQUATION = "Equation"
TELLS = "Tells itself by: {words}"
LOOKS_LIKE = "Looks like: {names}"
SEPARATES = "Separated by: {words}"
SHOWN_BESIDE = "Show the drive without effects beside it"
NO_EFFECTS = "No effect is switched on."
ALL_OFF = "Switch all off"
AGAINST = "Missing force against {name}"
VELOCITY, DEFLECTION, COMMAND, PLACE = "velocity v", "deflection δ", "command u", "place x"
MISSING_FORCE = "missing force"
CART = "cart {number}"
SIGNATURE_SUMMARY = "Missing force against {name}; at most {force:.3g} {unit}."
WITHOUT_EFFECTS = "{name}, without effects"
FILTER = "Find an effect"

# recordings
RECORDINGS_LEAD = "Drop recordings, a whole folder of them, or a drive (.toml). They stay on this machine."
DROP = "Drop files or a folder here, or choose them"
CHOOSE_FILES, CHOOSE_FOLDER = "Choose files", "Choose a folder"
TOO_LARGE = "{name} is larger than {most} MB. Leave out what is no recording, or compress it."
TOO_MANY = "At most {most} files are taken. Leave some out."
WRONG_KIND = "{name} is no recording: the page reads {kinds}."
UPLOAD_FAILED = "{name} was not taken: {reason}"
FORGET = "Forget all recordings"
NOTHING_READ = "No recording yet."
UNREADABLE = "{file}: {reason}"
CHECKING = "Checking …"
READY, NOT_READY = "Enough to identify the drive.", "Not enough to identify the drive."
IDENTIFY = "Identify"
TIED = "With the handout's ratios"
DIAGNOSE = "Diagnose"
REPORT = "Handout report"
CANCEL = "Cancel"
CANCELLED = "Cancelled; nothing was half-written."
FAILED = "{what} failed: {reason}"
CRASHED = "it ended with code {code} and said nothing"
RUNNING = "{what}: {stage}"
DONE = "{what}: done in {seconds:.0f} s"
BUSY = "Another computation of this page is running; cancel it first."
MEASURED, SIMULATED = "measured", "simulated"
OVERLAY = "Measured and simulated"
OVERLAY_HINT = "Drag over the chart to look closer; double-click shows all."
RECORDING = "Recording"
CHANNEL = "Signal"
FIT_RMS = "rms of the difference {rms}"
DOWNLOAD = "Download {name}"
SHOW_REPORT = "Open the report"
IDENTIFIED = "Identified from your recordings"
IDENTIFIED_TIED = "Your recordings, the handout's ratios"
DIAGNOSED = "Diagnosed from your recordings"
VERDICTS = {
    "no_mismatch": "No mismatch: the drive explains the recordings.",
    "explained": "Explained: what was left out has a name.",
    "partly_explained": "Partly explained.",
    "unexplained": "Unexplained: something is left out that has no name here.",
}
QUANTITY, VALUE, INTERVAL, UNIT = "Quantity", "Value", "95 % interval", "Unit"

# the guided path
GUIDE_LEAD = (
    "The handout's in-lab session on this drive. Set the rig up, record it, and the report is made of your recordings."
)
RECORD = "Record this run"
RECORDED = "recorded"
GO = "Set the rig up"
MAKE_REPORT = "Make the report"
MISSING_STEPS = "Record 2.1, 2.5 and 2.6 at least; the report identifies the drive from 2.5 and 2.6."
STEPS = {
    "2.1": (
        "2.1 Non-collocated P-control, stable",
        "Feedback from x2 with Kp = {gain}. The second cart follows with a lag and rests where friction lets it.",
    ),
    "2.2": (
        "2.2 Critically stable",
        "Raise Kp until the vibration just does not grow. The lamp turns later than linear theory says: friction damps it.",
    ),
    "2.3": ("2.3 Unstable", "Raise Kp a little more: the vibration grows to the command limit."),
    "2.4": (
        "2.4 Collocated",
        "The same gain, fed back from x1: stable, for the motor cart's phase never reaches −180°.",
    ),
    "2.5": ("2.5 Step response", "Open loop, squares of ±{low} and ±{high} at {slow}. One button records both."),
    "2.6": (
        "2.6 Frequency response",
        "Open loop, sines of ±{sine} from {slow} to {fast}. One button records all fourteen.",
    ),
}
RECORD_ALL_SINES = "Record all fourteen sines"

# the exercise
EXERCISE_LEAD = "A rig conceals one effect. Choose experiments, look at the recordings, and say what it is."
NEW_RIG = "Conceal a new effect"
EXPERIMENT = "Experiment"
EXPERIMENTS = {"square": "Square", "sine": "Sine", "p_control": "P-control from x2"}
RUN_EXPERIMENT = "Run it"
RUNS_DONE = "{count} recordings of this rig"
FIT_RIG = "Fit a drive without effects"
YOUR_GUESS = "Your guess"
GUESS_NOTHING = "nothing is concealed"
GUESS = "That is my answer"
RIGHT = "Right: {truth}."
RIGHT_NAME = "The right effect at another place: it is {truth}."
WRONG = "It is {truth}."
WITH_PARAMETERS = "{truth}, with {parameters}"
NOTHING_CONCEALED = "nothing but the run-to-run variability of a real rig"
ASK_DIAGNOSIS = "What does the diagnosis say of the same recordings?"
FIRST_A_RIG = "Conceal an effect first."
MOST_RUNS = "A rig takes at most {most} experiments; conceal a new effect."
BAD_NAME = "its name or path is none that can be kept"
SAMPLE = "Load the bundled sample"
READING = "Reading …"
EXPERIMENTS_READ = "What was understood"
COLUMNS_READ = ("Recording", "What drove it", "Samples", "Signals")
GONE = "This page was closed or is too old; load it again."
NO_FILE = "There is no such file."
