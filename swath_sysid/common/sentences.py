"""The catalogue of sentences: every warning by its code, what the flags and the diagnostics add to it.

Values stand in braces by name. A key is a code, or a code and after a colon what tells its sentence from others.
"""

SENTENCES = {
    'absurd-values: run': '{source}: {number} values of {name} beyond {limit:g} left out: check its unit',
    'added-mass-diverges': 'added mass exceeds mass: the plugin applies it by the acceleration of the step before '
    'and diverges; identify again with the mass as weighed',
    'at-anchor': '{source}: never faster than {speed:.2f} m/s and {rate:.1f} deg/s, as if at anchor or drifting: '
    'left out; give runs under way',
    'at-bound': '{name} ended at the limit of its range ({value:.3g}): the runs do not determine it; leave it out, '
    'or add {runs}',
    'clocks-apart': '{path}: header stamps and times of arrival run apart, so that times of arrival are used for '
    'all topics: record with one clock',
    'compass-misaligned': '{source}: the craft moves {offset:.1f} deg to {side} of its heading on straight courses: '
    'heading and speeds were turned by that much; calibrate the compass',
    'constant-channel': '{source}: {name} never changes, as where nothing is measured: it is taken as unknown; '
    'check its sender',
    'constant-difference': 'the difference of the thrusts is constant, so that nothing separates yaw inertia and '
    'added masses from damping: add zig-zags and turns to both sides',
    'constant-thrust': 'the total thrust is constant, so that {separating} separates inertia and resistance: add '
    'thrust steps up and down on a straight course',
    'course-unstable': 'the craft does not keep a straight course by itself: at {speed:.2f} m/s small turns grow '
    '{growth:.2g} times a second, until damping ends that; steer it, and trust no forecast of its heading for '
    'longer than {time:.0f} s',
    'current-by-run': 'the drift of each run ({least:.2f} to {most:.2f} m/s: current, and what wind does like it) '
    'was found from its own motion; the model holds the mean, which validation uses; ask for one current for all '
    'runs if it was the same',
    'current-not-exported': "VRX's SimpleHydrodynamics has no current: that of the model, {east:.3g} m/s east and "
    '{north:.3g} m/s north, is left out',
    'damaged-bag': '{path} is damaged ({reason}): what is whole was read; stop the recorder before its power is cut',
    'damaged-messages': '{number} messages on {topic} are not of type {imu_type} and were left out: check the recorder',
    'damaged-messages: run': '{path}: {number} messages cannot be read and were left out: check the recorder',
    'diverged': '{diverged} of {windows} windows of the {label} runs ran away in free simulation: look at their '
    'thrust and speed',
    'dry-friction-scaled': 'b0 is dry friction of a rig or mooring, which does not scale with the hull: use the '
    'result with b0 = 0 unless such a rig exists there too',
    'empty-channel: run': '{source}: {name} holds no usable value and is left out',
    'forecast-missing': '{missing} forecasts were issued without a value for {axis} at a lead, and persistence '
    'stood in for them: see at which samples the sensor gave too little',
    'frame-assumed': '{source}: more thrust to starboard turns to negative yaw, so yaw is taken as in NED; state '
    'the frame (ned or enu): if it is ENU, port and starboard are swapped',
    'frame-id-changed': 'the messages on {topic} come in {frames} frames ({names}): if these are two sensors, '
    'record each on a topic of its own; else check whether the mounting is still right',
    'friction-necessary': 'dry friction is necessary: it improves the criterion of {equation} by {gain:.0f} (more '
    'than {criterion_margin:g} is decisive){effect}; look for it in the bearings or the mooring of the rig, and '
    'leave it out for the craft afloat',
    'hardly-moves': "'{name}' swings by {swing:.2g} deg only: if it is in rad, call it '{other}'",
    'held-samples': '{source}: {name} changes only at every {usual:.0f}th sample: the repetitions are taken as missing',
    'identical-files': '{path} has the same content as {original} and is left out: it would count twice as a repeat '
    'that it is not',
    'inertia-includes-added': 'Iz is yaw inertia and added inertia together, which free running cannot tell apart: '
    'give the inertia to see Nr_dot',
    'lag-like-surge': 'lag and mass can be exchanged: the lag of the thrusters ({lag:.2f} s) is near the time '
    'constant of surge ({surge:.2f} s), and their standard deviations leave that out; excite with {runs}, or '
    'measure the lag and give it',
    'length-assumed': 'the length is taken as that of a WAM-V 16, {default_length:.2f} m: give it if the prime '
    'system is of use',
    'lever-assumed': 'half the distance between the thrusters is taken as that of a WAM-V 16, {default_lever:.2f} '
    'm: give it, all yaw derivatives are proportional to it',
    'loading-curvature-unknown': 'the model was identified at two values of {quantity} only, so that how its ratios '
    'bend between them is unknown: add trials at a third',
    'loading-outside': 'the model was identified for {quantity} {lowest:g} to {highest:g} and is not extrapolated '
    'to {loading:g}: that of {nearest:g} is used; add trials at this loading',
    'made-stable': 'with {removed} the model was unstable at speeds it was identified at: taken out; add turns at '
    'several speeds to identify them',
    'manoeuvres-beside': '{record} also holds odometry and thrust, which are left aside here: swath-sysid manoeuvre '
    'play-through forecasts surge, sway and yaw from them',
    'mass-not-given': 'm is mass and added mass in surge together, which free running cannot tell apart: give the mass',
    'missing-rows': '{source}: {number} rows hold no measured value and are bridged by the simulation: check the '
    'logger if they are many',
    'mixed-frames': '{source}: heading and position are in different frames (one in NED, one in ENU): the heading '
    'is taken as {turn} deg minus what was recorded; give both in one frame',
    'mixed-frames: turned': '{source}: the heading is off the course by {turn} deg and was turned by that much: '
    'check which axis heading and position are measured from',
    'model-doubtful': 'the {axis} model is {verdict}: {sentence}',
    'motion-simplified': 'Nav2 moves a craft along its heading at the speed asked for: this one drifts by up to '
    '{drift:.3g} deg and its speed changes by {change:+.0%} in the hardest turn at the highest speed',
    'no-friction': 'dry friction is not needed: it worsens the criterion of {equation} by {gain:.0f}',
    'no-header-stamps': '{topic} carries no header stamps, so the times of arrival are used: have the driver stamp '
    'its messages',
    'no-model': 'no {axis} model has arrived, so the forecast does without one: identify the hull',
    'no-speed': 'no run holds a speed: surge is assumed, not identified; add surge_m_s, or position and heading',
    'no-sway': 'no run holds a sway velocity: what it does is assumed; add sway_m_s, or position and heading',
    'no-thrust': '{source}: the thrust is always zero: left out; give runs under way',
    'no-turn': 'no run turns (yaw rate within {rate:.1f} deg/s) under a difference of the thrusts: yaw and sway are '
    'assumed, not identified; add turns and zig-zags',
    'no-waves': 'no waves have been fitted yet: forecasts improve within a minute or two',
    'not-separable: derivatives': '{other} and {name} cannot be told apart on these runs (correlation '
    '{correlation:+.3f}): use them together only, or add {runs}',
    'outlier': '{name} {value:.3g} was refused: expected {expected:.3g}',
    'outside-valid-amplitude': '{axis} swings by {reached:.1f} deg, but its model was found at {largest:.1f} deg '
    'and less: its forecasts may be further off than they say; identify again after a release from a larger angle',
    'poor-simulation': 'free simulation explains little of the {label} runs ({channels}; r2): wind, waves, a wrong '
    'thrust or a reversed channel; look at the pictures',
    'restoring-not-exported': '{axis}: gz-sim takes restoring from the Buoyancy plugin and the shape of the hull: '
    'see that it gives {stiffness:.4g} N m/rad, for a natural period of {natural_period:.4g} s',
    'restoring-not-exported: unstable': '{axis}: this hull is not stable at its trim; gz-sim takes restoring from '
    'the shape of the hull, and only its damping is exported',
    'scale-not-given': 'free running gives only ratios to mass: all derivatives are per kg of craft; give the mass '
    'or the thrust of one thruster at full command',
    'sensor-followed': '{name} jumped and stayed: the filter follows it; check the sensor',
    'short-rows': '{number} rows end early, the first in line {line}: their missing cells are taken as missing '
    'values; check that the file was written to the end',
    'speed-derived': '{source}: no {missing}: derived from position and heading',
    'spikes: run': '{source}: {number} values of {name} jump away for a moment and are left out: look at the sensor '
    'if they are many',
    'strange-inertia': 'the craft answers to thrust as if it weighed {apparent:.4g} kg, not {mass:.4g} kg: check '
    'the mass and the scale of the thrust',
    'surge-inertia-assumed': 'thrust scale and added mass in surge cannot be told apart with commands: Xu_dot is '
    'taken as {added_mass:g} kg; give the thrust of one thruster at full command to identify it',
    'surge-reversed': '{source}: the speed is negative under positive thrust and is reversed: check its sign, or '
    'that of both thrusts',
    'surge-reversed: by position': '{source}: surge is opposite to the change of position and is reversed: check '
    'its sign',
    'sway-reversed': '{source}: sway is opposite to the change of position and is reversed: check its sign',
    'sway-scale-assumed': 'nothing drives a craft sideways, so that its masses and damping in sway are known to a '
    'common factor only, which their standard deviations leave out: Yur is taken equal to Xu_dot, as in potential '
    'flow; give Yv_dot or Yur where it is known',
    'taken-as-commands': '{path}: the thrusters stay within -1 and 1 and are taken as normalised commands; if they '
    'are N, say so',
    'terms-dropped': '{target} cannot express {named}{instead}: see how far the tests differ',
    'terms-dropped: decay': '{axis}: gz-sim cannot express {named}: of a decay from {angle:.3g} deg crest {crests} '
    'of the model and as exported: {time}; {height}',
    'tests-differ': '{test} of the model and as exported: {changes}',
    'text-in-numbers': "{number} cells that are not numbers taken as missing, the first '{cell}' in line {line}, "
    'column {column}: correct them if they matter',
    'thrust-gaps': '{source}: the thrust is missing for {lost:.0f} s, which are left out: if commands are published '
    'only while driving, say that a gap means zero',
    'thrust-reversed': '{source}: the craft moves astern under positive thrust: both thrusts are reversed; check '
    'their sign',
    'thrusters-swapped': '{source}: more thrust to starboard turns to starboard in the frame stated ({frame}), so '
    'port and starboard were exchanged; check the channels, or the frame',
    'time-disorder': '{source}: {number} rows with missing, repeated or backward time left out: check the recorder',
    'twist-in-world-axes': '{path}: the twist of the odometry is in world axes and was turned into body axes: '
    'publish it in child_frame_id, as nav_msgs/Odometry defines',
    'uncertain': '{name} is uncertain by {std:.3g} beside a value of {value:.3g}: add {runs}',
    'unit-missing': 'columns without a unit left out ({columns}): {unit_advice}',
    'unstable': 'the model is unstable at speeds it was identified at{where}: do not use it; add turns at several '
    'speeds',
    'viscous-scale-effect': 'Froude scaling keeps wave damping, but not viscous damping: the Reynolds number '
    'changes by a factor {factor:.3g}, so that the frictional part of {damping} will be {side} than scaled here; '
    'correct it with a friction line (ITTC 7.5-02-07-04.5) or confirm it at the other scale',
    'yaw-rate-derived': '{source}: no yaw rate: it is derived from the heading',
    'yaw-rate-reversed': '{source}: yaw rate and heading turn opposite ways (one in NED, one in ENU): the yaw rate '
    'is reversed; give both in one frame',
}

#: What does it on the command line, by the code of an `Advice` or an `InputError`.
FLAGS = {
    'added-mass-diverges': '--fix m=KG',
    'current-by-run': '--current shared',
    'disturbed-tail': '--end',
    'forced-motion': '--at-sea, or --start and --end',
    'inertia-includes-added': '--inertia',
    'lag-like-surge': '--fix lag=S',
    'late-start': '--start',
    'length-assumed': '--length',
    'lever-assumed': '--lever',
    'manifest-exists': '--output',
    'mass-not-given': '--mass',
    'no-decay': '--start and --end',
    'no-distributed': '--scheduler',
    'no-function-name': '--output',
    'no-inertia': '--inertia AXIS=KG_M2',
    'no-process': '--jobs',
    'not-a-manifest': '--new FOLDER',
    'output-over-input': '--output',
    'poor-fit': '--start and --end',
    'scale-not-given': '--mass or --thrust-per-command',
    'sea-not-fitted': '--start and --end',
    'several-decays': '--start and --end',
    'several-topics': '--odometry-topic, --imu-topic, --port-topic, --starboard-topic',
    'store-in-use': '--output',
    'surge-inertia-assumed': '--thrust-per-command',
    'sway-scale-assumed': '--fix Yv_dot=KG',
    'taken-as-commands': '--thrust-input force',
    'thrust-gaps': '--gap-means-zero',
    'thrust-input-differs': '--thrust-input',
    'times-of-trial': '--duration, --rate, --hold',
    'worker-killed': '--jobs',
}

#: What a reason that is counted in /diagnostics means, and what to do about it.
REASONS = {
    'absurd-covariance': 'covariances of more than half a turn, or 35 rad/s, were taken as unknown: let the driver '
    'give them in rad^2 and rad^2/s^2, or all zero where they are unknown',
    'absurd-value': 'values that no craft reaches were left out: check that rates are rad/s and accelerations m/s^2',
    'bad-loading': 'a draft or displacement that is not a positive number came in, the one before it stays: check '
    'what publishes it',
    'bad-model': 'a model description could not be read, the model before it stays: publish what `identify` writes',
    'bad-model-file': 'the model file cannot be used and is not written over: correct it or move it away, and start '
    'again',
    'bad-quaternion': 'invalid quaternions were left out, rates were used: if the sensor has no orientation, let '
    'the driver set orientation_covariance[0] to -1',
    'bad-window': 'a motion window could not be read: publish what imu_buffer publishes',
    'clock-jumped-back': 'the clock was set back (a bag that looped?): the window and the state of motion were '
    'restarted, hull and sea are kept',
    'duplicate-stamp': 'samples with the stamp of one before were left out: if many, have the driver stamp its '
    'messages',
    'frame-id-changed': 'the frame_id of the messages changed: two sensors may share the topic, or the driver was '
    'reconfigured; give each sensor a topic of its own, and check whether the mounting is still right',
    'gap': 'samples are missing: check the load of the machine and of the network',
    'gap-too-long': 'the sensor was silent for long and came back: check its driver and cable',
    'gate-restarted-pitch': 'the sensor contradicted the filter until the filter was restarted: identify again if '
    'this repeats',
    'gate-restarted-roll': 'the sensor contradicted the filter until the filter was restarted: identify again if '
    'this repeats',
    'identification-worker-died': 'the process that identifies died and was started again: look for a lack of memory',
    'late-fit': 'a fit of the waves came later than 0.5 s after its samples, and was used only from then on: '
    'forecasts differ a little from those of play-through; check the load of the machine if that matters',
    'loading-advice': 'the draft is outside the range of its model: see the log, and add trials at this draft',
    'model-not-saved': 'the model file could not be written: check model_path, its folder and its permissions',
    'near-vertical': 'samples with pitch beyond 80 deg were left out, where roll and yaw cannot be distinguished: '
    'if there are more and more, the sensor stands on end: set mounting_deg to [0, 90, 0] or [0, -90, 0]',
    'no-orientation': 'the sensor gives no orientation, rates alone are used',
    'no-rates': 'the sensor gives no rates, forecasts are less certain, most of all in the first seconds: let the '
    'driver publish angular_velocity, if the sensor has it',
    'not-finite': 'NaN or infinite values were left out: check the driver',
    'nothing-usable': 'messages with nothing usable in them were left out: check the driver',
    'out-of-order': 'late samples were left out: check the transport, and look for a second publisher',
    'outlier-pitch': 'samples that contradict the forecast were rejected: look for shocks or magnetic disturbance',
    'outlier-roll': 'samples that contradict the forecast were rejected: look for shocks or magnetic disturbance',
    'passed-over': 'samples had waited in a queue: the filters used them, forecasts were issued from newer ones '
    'only; check the load of the machine',
    'qos-mismatch': 'a publisher and a subscription have incompatible QoS and do not connect: compare both with '
    '`ros2 topic info --verbose`',
    'rate-changed': 'the sample rate changed, and the new one is used: check the driver if this was not intended',
    'sensor-silent': 'the sensor stopped publishing: check its driver and cable',
    'several-publishers': 'more than one node publishes the IMU topic: stop one, or remap them apart',
    'stray-stamp': 'single samples with a stamp far away were left out: check what stamps them',
    'unknown-covariance': 'the sensor does not report its noise, which is therefore measured',
    'wave-worker-died': 'the process that fits the waves died and was started again: look for a lack of memory',
    'waves-not-fitted': 'the waves could not be fitted, forecasts go on with the fit before, or with none: see the log',
}

#: What to do about a state that is reported in /diagnostics but not counted.
STATES = {
    'clock-stands-still': 'the replay is paused, or nothing publishes /clock',
    'clocks-differ': 'synchronise the clocks, or replay with --clock and set use_sim_time',
    'messages-queued': 'they wait in a queue, check the load of the machine, the driver and the network; or a clock '
    'was set',
    'no-message-yet': 'check that the sensor publishes there, or remap the topic',
    'short-of-memory': 'samples come faster than max_rate_hz, which makes the window shorter: raise max_rate_hz',
}

CURES = {**REASONS, **STATES}


def with_flags(code: str, message: str) -> str:
    """A sentence with the flags, by its code, that do on the command line what it advises."""
    return f'{message} ({FLAGS[code]})' if code in FLAGS else message


def reasons_table() -> str:
    """Every reason that is counted and what to do about it, as a Markdown table."""
    rows = [f'| `{reason}` | {cure.replace("|", "/")} |' for reason, cure in REASONS.items()]
    return '\n'.join(['| counted as | what it means, and what to do |', '|---|---|', *rows]) + '\n'
