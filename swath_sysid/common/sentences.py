"""The catalogue of sentences: every warning by its code, what the flags and the diagnostics add to it.

Values stand in braces by name. A key is a code, or a code and after a colon what distinguishes its sentence.
"""

SENTENCES = {
    'angle-against-rate': 'the measured rate differs from the slope of the measured angle by {mismatch:.0%} of itself: '
    'check unit, sign and delay of both columns',
    'absent-term': '{equation} lacks a term that the motion shows ({term}, {stds:.0f} standard deviations from zero), '
    'which biases its other coefficients: fit an equation that has {term}',
    'absurd-values': 'impossible values were left out ({channels}): check the units in the column names, and look for '
    'damaged packets',
    'absurd-values: run': '{source}: {number} values of {name} beyond {limit:g} were left out: check its unit',
    'accelerations-in-g': 'the accelerations average {force:.2f} where gravity is {gravity:.2f} m/s^2: they are in g; '
    'give them in m/s^2 (multiplied by {gravity:.2f})',
    'added-mass-diverges': 'added mass exceeds mass, and the plugin, which applies it with the previous acceleration, '
    'diverges; identify again with the mass as weighed',
    'angle-late': 'the {axis} angle comes {lag:.2f} s after the {axis} rate: have the driver stamp both when they are '
    'measured and look for a slow filter on the angle, or move its column by as much',
    'angles-frozen': 'the orientation has been the same for {seconds:g} s while the rates show motion: check what '
    'gives the orientation, or have the driver set orientation_covariance[0] to -1',
    'at-anchor': '{source} was left out, because the craft never exceeds {speed:.2f} m/s and {rate:.1f} deg/s, as if '
    'at anchor or drifting: give runs under way',
    'at-bound': '{name} reached the bound of its range ({value:.3g}), so the runs do not determine it: leave it out, '
    'or add {runs}',
    'axes-of-sensor': '{reading}, which the attitude contradicts: rates and accelerations are turned by {turn} deg '
    '(roll, pitch, yaw) against the orientation; let the driver give all in the axes of the sensor and set '
    'mounting_deg to {mounting}',
    'axes-of-sensor: hanging': '{reading}: set frame to {other_frame} if its axes are {other_axes}, or, if it hangs '
    'upside down, set mounting_deg to {mounting} (roll, pitch, yaw, of which the yaw does not show)',
    'axes-of-sensor: not right-angled': 'gravity is {off:.0f} deg away from where the attitude puts it, which no '
    'right-angled mounting explains: have the driver give orientation and accelerations in the same axes, and '
    'mounting_deg say how these are mounted',
    'axes-of-sensor: on its side': '{reading}: set mounting_deg to {mounting} (roll, pitch, yaw, of which the yaw does'
    ' not show)',
    'axes-of-sensor: other frame': '{reading}, opposite to that of the attitude: its axes are {other_axes}; set frame '
    'to {other_frame} (or, if they are {axes}, have the driver give the specific force, which points up at rest)',
    'body-rates': 'the angles or a gyro axis are unknown, so body rates are used as Euler rates, which holds for small '
    'angles only: record roll, pitch and all three gyro axes',
    'clocks-apart': '{path}: header stamps and times of arrival drift apart, so times of arrival are used for all '
    'topics: record with one clock',
    'columns-misspelt': 'columns that are not read: {pairs}',
    'compass-misaligned': '{source}: the craft moves {offset:.1f} deg to {side} of its heading on straight courses, '
    'and heading and speeds were turned by that much; calibrate the compass',
    'constant-channel': '{source}: {name} is constant, as if it were not measured, and is treated as unknown: check '
    'the device that sends it',
    'constant-difference': 'the difference of the thrusts is constant, so yaw inertia and added masses cannot be '
    'separated from damping: add zig-zags and turns to both sides',
    'constant-thrust': 'the total thrust is constant, so {separating} separates inertia and resistance: add thrust '
    'steps up and down on a straight course',
    'course-unstable': 'the craft does not keep a straight course by itself: at {speed:.2f} m/s small deviations grow '
    'at a rate of {growth:.2g} 1/s. Steer it, and do not trust forecasts of its heading beyond {time:.0f} s',
    'current-by-run': 'the drift by current and wind ({least:.2f} to {most:.2f} m/s) was estimated for each run, and '
    'the model holds the mean, which validation uses: use one current for all runs if it did not change',
    'current-not-exported': "VRX's SimpleHydrodynamics has no current: that of the model, {east:.3g} m/s east and "
    '{north:.3g} m/s north, is left out',
    'damaged-bag': '{path} is damaged ({reason}), and only its intact part was read; stop the recorder before its '
    'power is cut',
    'damaged-messages': '{path}: {number} messages cannot be read and were left out: check the recorder',
    'decay-of-other-axis': '{source} also holds a free decay in {axis}, from {start:.1f} to {end:.1f} s, which is not '
    'used: identify that axis by itself',
    'disturbed-tail': 'the motion after {end:.1f} s was left out because its half-cycles or its period jump there, '
    'when {left:.0f} % of the first half-cycle was left: inspect it, and give a later end if it belongs to the decay',
    'disturbed-tail: bounds': 'the motion before the given end seems free only until {found:.1f} s, where its '
    'half-cycles or its period jump: give this as the end, unless the craft was free until {end:.1f} s',
    'diverged': '{diverged} of {windows} windows of the {label} runs diverged in free simulation: look at their thrust '
    'and speed',
    'dry-friction-scaled': 'b0 is dry friction of a rig or mooring, which does not scale with the hull: set b0 to 0 in '
    'the result, unless a similar rig is used at that scale',
    'empty-channel': '{channels} without any usable value were left out: check that the sensor was set to send them',
    'empty-channel: run': '{source}: {name} holds no usable value and is left out',
    'equivalent-linear': 'motion in waves shows only the equivalent linear damping at an amplitude of {amplitude:.2g} '
    'deg, not how damping depends on amplitude: for larger motions record a free decay in still water',
    'few-samples': 'only {usable:.0%} of the recorded rows have a distinct time: write the time with more digits',
    'forced-motion': '{name} oscillates from start to end (standard deviation {spread}) and never dies out, as in '
    'waves. At sea this gives the natural period, and the damping at its amplitude; for more, record a release in '
    'still water, or give start and end of a decay',
    'forced-motion: bounds': 'between {start:.1f} and {end:.1f} s the motion oscillates from start to end and never '
    'dies out, as it does in waves: give the bounds of a free decay',
    'forecast-missing': '{missing} forecasts had no value for {axis} at a lead and were replaced by persistence: see '
    'at which samples the sensor gave too little',
    'frame-assumed': '{source}: more thrust to starboard gives a negative yaw rate, so yaw is assumed to be in NED: '
    'state the frame (ned or enu). If it is ENU, port and starboard are swapped',
    'frame-id-changed': 'the messages on {topic} come in {frames} frames ({names}): if these are two sensors, record '
    'each on a topic of its own; else check whether the mounting is still right',
    'friction-necessary': 'dry friction improves the criterion of {equation} by {gain:.0f} (more than '
    '{criterion_margin:g} is decisive){effect}; look for it in the bearings or the mooring of the rig, and leave it '
    'out for the craft afloat',
    'gaps': '{gaps} in the time base, the longest of {longest:.4g} s after t = {time:.6g} s (samples come every '
    '{median:.4g} s): nothing is filled in; choose a part without gaps if the fit is poor',
    'gaps: decay': 'the decay has {gaps} longer than a quarter of its period, the longest of {longest:.2g} s at '
    '{time:.1f} s: the fit bridges this, but record again if the first cycles are missing',
    'gravity-missing': 'the accelerations average {force:.2f} m/s^2, without gravity: have the driver publish the '
    'specific force, which is {gravity:.2f} m/s^2 upward at rest, or no accelerations',
    'held-samples': '{source}: {name} changes only every {usual:.0f}th sample, so repeated values are treated as '
    'missing',
    'holds-decay': 'this record contains a free decay, which shows more about the hull: identify it as a decay',
    'identical-files': '{path} has the same content as {original} and was left out, because a copy is not a repeat',
    'implausible-period': 'the natural period came out as {period:.4g} s, more than {longest:g} s: check the unit of '
    'the time column, which may count milliseconds (time_ms) or samples (time_samples)',
    'inertia-includes-added': 'Iz includes added inertia, which free running cannot separate: give the inertia to see '
    'Nr_dot',
    'invalid-orientation': '{invalid} of {number} quaternions are invalid and were left out: check the sensor driver',
    'late-start': 'the motion after the given start seems free only from {found:.1f} s on: give this as the start, '
    'unless the craft was free from {start:.1f} s',
    'leads-between-samples': 'samples come every {interval:.3g} s, so motion {leads} s ahead was not measured but '
    'interpolated, and the scores at these leads show too little error: give leads of {interval:.3g} s or more',
    'length-assumed': 'the length is taken as that of a WAM-V 16, {default_length:.2f} m: give it if you use the prime '
    'system',
    'lever-assumed': 'half the distance between the thrusters is taken as that of a WAM-V 16, {default_lever:.2f} m: '
    'give it, because all yaw derivatives are proportional to it',
    'loading-curvature-unknown': 'the model was identified at two values of {quantity} only, so the curvature of its '
    'ratios between them is unknown: add trials at a third',
    'loading-outside': 'the model was identified for {quantity} {lowest:g} to {highest:g} and is not extrapolated to '
    '{loading:g}: the model at {nearest:g} is used; add trials at this loading',
    'low-rate': 'the record has {samples:.1f} samples per period, and {needed:g} are needed to follow the motion: '
    'record at {rate:.3g} Hz or more',
    'made-stable': 'with {removed} the model was unstable at the speeds of the runs, so they were removed: add turns '
    'at several speeds to identify them',
    'manoeuvres-beside': '{record} also holds odometry and thrust, which are ignored here: swath-sysid manoeuvre '
    'play-through forecasts surge, sway and yaw from them',
    'mass-not-given': 'm includes the added mass in surge, which free running cannot separate: give the mass',
    'missing-rows': '{source}: {number} rows hold no measured value and are bridged by the simulation: check the '
    'logger if there are many',
    'missing-stamps': '{rows} without a finite time were left out: check the device that wrote the stamps',
    'missing-values': 'missing values ({channels}) are left out of the fit',
    'mixed-frames': '{source}: heading and position are in different frames (one in NED, one in ENU), so the heading '
    'was replaced by {turn} deg minus the recorded one: give both in one frame',
    'mixed-frames: turned': '{source}: the heading is off the course by {turn} deg and was turned by that much: check '
    'from which axis heading and position are measured',
    'model-contradicted': 'the motion shows {change:.0%} {more} {quantity} than the {axis} model ({stds:+.1f} of '
    'its standard deviations): identify again',
    'model-doubtful': 'the {axis} model is {verdict}: {sentence}',
    'motion-simplified': 'Nav2 moves a craft along its heading at the commanded speed: this one drifts by up to '
    '{drift:.3g} deg and its speed changes by {change:+.0%} in the hardest turn at the highest speed',
    'motion-uncertain': 'the record leaves the next release uncertain {size}: add another release, or release from a '
    'larger angle',
    'no-decay': 'no free decay was found in {name}: it moves by {reach}, but not as a steadily shrinking oscillation '
    'with rest before or after. Record a release in still water until it has died out, or give start and end of a '
    'decay',
    'no-friction': 'dry friction is not needed: it worsens the criterion of {equation} by {gain:.0f}',
    'no-header-stamps': '{topic} has no header stamps, so times of arrival are used: have the driver stamp its '
    'messages',
    'no-model': '{axis} is forecast without a hull model, until one is identified',
    'no-period': 'the fit has no natural period of small motions: choose the decay by its start and end, or release '
    'the craft again in still water',
    'no-release': 'the craft may have been moved and not released, because {seen}: hold it still at an angle in still '
    'water, and let it go',
    'no-speed': 'no run contains a speed, so surge is assumed, not identified: add surge_m_s, or position and heading',
    'no-sway': 'no run contains a sway velocity, so sway is assumed, not identified: add sway_m_s, or position and '
    'heading',
    'no-thrust': '{source} was left out, because its thrust is always zero: give runs under way',
    'no-turn': 'no run turns (yaw rate within {rate:.1f} deg/s) under a difference of the thrusts, so yaw and sway are '
    'assumed, not identified: add turns and zig-zags',
    'no-waves': 'no waves have been learnt yet: forecasts improve within a minute or two',
    'not-separable: derivatives': '{other} and {name} cannot be told apart on these runs (correlation '
    '{correlation:+.3f}): use them together only, or add {runs}',
    'numba-disabled': 'NUMBA_DISABLE_JIT is set, so fits take longer than they could; unset it',
    'numba-fails': 'numba is installed but cannot be loaded ({error}), so fits take longer than they could; install '
    'versions of numba and numpy that fit each other, or remove numba',
    'one-sided': 'the largest release is to one side, so the forecast of one from a {side} angle may be '
    'wrong{size}: release the craft from that side too',
    'one-sided: vanishing': 'the largest release is to one side, and to the other the restoring moment of this fit '
    'vanishes at about {angle:.1f} deg: release the craft from a {side} angle too, but from a smaller one',
    'one-step-biased': 'the one-step objective is biased under measurement noise, and its damping is too large: use '
    'the simulation objective for a model that forecasts',
    'out-of-order-stamps': '{rows} out of order were left out: split the file if it holds two recordings, or a replay '
    'that looped',
    'other-unit-likely': "'{name}' moves by {amplitude:.2g} {unit}: if it is in {other}, let its name say so",
    'outlier': '{name} {value:.3g} was rejected: expected {expected:.3g}',
    'outside-valid-amplitude': '{axis} reaches {reached:.1f} deg, but its model was identified at {largest:.1f} deg '
    'and less, so forecast errors may exceed their intervals; identify again after a release from a larger angle',
    'poor-fit': '{left:.0%} of the motion is neither explained by the fit nor white noise: release the craft in still '
    'water, name no equation, or check units, signs and times of the columns and the bounds of the decay',
    'poor-simulation': 'free simulation explains little of the {label} runs ({channels}; r2): look in the pictures for '
    'wind, waves, a wrong thrust or a reversed channel',
    'rate-late': 'the {axis} rate comes {lag:.2f} s after the {axis} angle: have the driver stamp both when they are '
    'measured and look for a slow filter on the rate, or move its column by as much',
    'rate-offset': 'the {axis} rate differs by {offset:+.1f} deg/s from the derivative of the {axis} angle: calibrate '
    'the gyroscope at rest, or subtract this offset',
    'rate-scale': 'the {axis} rate is {gain:.3g} times the derivative of the {axis} angle: check the units of angle, '
    'rate and time, and the scale of the gyroscope',
    'rate-sign': 'roll and pitch rate are the derivatives of their angles with the opposite sign, while the '
    'accelerations are as they should be: reverse the signs of the rates in the driver or the file',
    'rate-sign: one': 'the {axis} rate is the derivative of the {axis} angle with the opposite sign: reverse one of '
    'the two (roll is positive to starboard, pitch bow down, and so are their rates)',
    'rate-sign: perhaps turned': 'roll and pitch rate are the derivatives of their angles with the opposite sign: '
    'reverse the signs of the rates in the driver or the file, unless rates and accelerations are turned by {turn} deg'
    ' (roll, pitch, yaw) against the orientation: then set mounting_deg to {mounting}',
    'rate-unit': 'the {axis} rate is {gain:.3g} times the derivative of the {axis} angle: {unit}; give each in the '
    'unit expected, or name the one it is in',
    'rate-unrelated': 'the {axis} angle moves and its rate does not follow it at any delay: check what gives the rate,'
    ' or leave it out',
    'rates-swapped': 'the roll rate follows the pitch angle and the pitch rate the roll angle: exchange the x and y '
    'gyroscopes',
    'rates-swapped: reversed': 'the roll rate follows the pitch angle and the pitch rate the roll angle: exchange the '
    'x and y gyroscopes, and reverse both',
    'rates-turned: half': 'roll and pitch rate are the derivatives of their angles with the opposite sign, and the '
    'accelerations are opposite too: rates and accelerations are turned by {turn} deg (roll, pitch, yaw) against the '
    'orientation; let the driver give all in the axes of the sensor and set mounting_deg to {mounting}',
    'rates-turned: quarter': 'the roll rate follows the pitch angle and the pitch rate the roll angle, one of them '
    'reversed: rates and accelerations are turned by {turn} deg (roll, pitch, yaw) against the orientation; let the '
    'driver give all in the axes of the sensor and set mounting_deg to {mounting}',
    'record-not-adequate': 'not adequate by themselves, {number} of {records} records ({names}): see their verdicts',
    'repeated-stamps': '{rows} with the same stamp as the previous row were left out: if most rows are affected, write '
    'the time with more digits',
    'restoring-not-exported': '{axis}: gz-sim takes restoring from the Buoyancy plugin and the shape of the hull: '
    'check that it gives {stiffness:.4g} N m/rad, for a natural period of {natural_period:.4g} s',
    'restoring-not-exported: unstable': '{axis}: this hull is not stable at its trim; gz-sim takes restoring from the '
    'shape of the hull, and only its damping is exported',
    'rounded-stamps': 'the stamps are rounded to {resolution:.4g} s, about {each} rows each: they were spread evenly, '
    'one every {interval:.4g} s; write the time with more digits',
    'runaway': 'no hull of {equation} follows the {axis} from {spans}, each tried runs away: choose bounds that begin '
    'at the release, or another equation',
    'saturation': 'the {axis} {name} is cut off at {level:.3g} {unit} in {half_cycles}: the sensor saturates there; '
    'set a wider range, or release from a smaller angle',
    'scale-not-given': 'free running gives only ratios to mass: all derivatives are per kg of craft; give the mass or '
    'the thrust of one thruster at full command',
    'sea-hides-hull': 'the waves (peak period of the exciting moment {peak:.3g} s) show little of the hull: its period '
    'is known to {period:.1f} %, its damping to {damping:.0f} %. Record longer than {minutes:.0f} minutes, on another '
    'heading or in another sea, or record a free decay in still water',
    'sea-not-fitted': 'no single sea explains the motion (misfit {misfit:.1f}; 1 is a good fit), so the uncertainty '
    'was widened: look for swell beside wind waves, a mooring, a changing speed or a helm. Choose a stretch on a '
    'steady course, or record a free decay in still water',
    'sensor-followed': '{name} jumped and stayed there, so the filter follows it: check the sensor',
    'sensor-frozen': 'every value of the sensor has been the same for {seconds:g} s while its stamps go on: restart '
    'its driver, and look for one that repeats its last message',
    'sensor-turned': 'the attitude averages roll {roll} deg and pitch {pitch} deg, at which no craft floats, so this '
    'is its mounting: set mounting_deg to {mounting} (roll, pitch, yaw, of which the yaw does not show)',
    'several-decays': '{number} free decays were found, and only the one with most motion is used, from {start:.1f} to '
    '{end:.1f} s: make each of the others a trial of its own, by its start and end ({others})',
    'short-rows': '{number} rows end early, the first in line {line}, and their missing cells are treated as missing '
    'values: check that the file was written to the end',
    'speed-derived': '{source} has no {missing}: it was derived from position and heading',
    'spikes': 'the {axis} {name} of the decay has {samples} far from their neighbours, left out of the fit: look for '
    'lost or damaged packets',
    'spikes: run': '{source}: {number} values of {name} are isolated spikes and were left out: check the sensor if '
    'there are many',
    'stability-changed': 'the natural period of roll went from {before:.3g} to {now:.3g} s, so the metacentric height '
    'is {share:.2f} ({low:.2f} to {high:.2f}) of its earlier value: look for added or shifted weight, and for water in '
    'the hull',
    'strange-inertia': 'the craft responds to thrust as if its mass were {apparent:.4g} kg, not {mass:.4g} kg: check '
    'the mass and the scale of the thrust',
    'surge-inertia-assumed': 'thrust scale and added mass in surge cannot be separated with commands, so Xu_dot is '
    'taken as {added_mass:g} kg; give the thrust of one thruster at full command to identify it',
    'surge-reversed': '{source}: the speed is negative under positive thrust and was reversed: check its sign, or that '
    'of both thrusts',
    'surge-reversed: by position': '{source}: surge is opposite to the change of position and was reversed: check its '
    'sign',
    'sway-reversed': '{source}: sway is opposite to the change of position and was reversed: check its sign',
    'sway-scale-assumed': 'nothing drives the craft sideways, so its masses and damping in sway are known to a common '
    'factor only, which their standard deviations do not include: Yur is taken equal to Xu_dot, as in potential flow; '
    'give Yv_dot or Yur if known',
    'taken-as-commands': '{path}: the thrusters stay within -1 and 1 and are treated as normalised commands: if they '
    'are in N, state it',
    'terms-dropped': '{target} cannot express {named}{instead}: see how far the tests differ',
    'terms-dropped: decay': '{axis}: gz-sim cannot express {named}. For crest {crests} of a decay from {angle:.3g} '
    'deg, the model and its export have {time}; {height}',
    'tests-differ': '{test} of the model and of its export: {changes}',
    'text-in-numbers': "{number} cells are not numbers and are treated as missing, the first '{cell}' in line {line}, "
    'column {column}: correct them if they matter',
    'thrust-gaps': '{source}: the thrust is missing for {lost:.0f} s, which are left out: if commands are published '
    'only while driving, say that a gap means zero',
    'thrust-reversed': '{source}: the craft moves astern under positive thrust, so both thrusts were reversed: check '
    'their sign',
    'thrusters-swapped': '{source}: more thrust to starboard turns to starboard in the stated frame ({frame}), so port '
    'and starboard were exchanged; check the channels, or the frame',
    'time-disorder': '{source}: {number} rows with missing, repeated or backward time were left out: check the '
    'recorder',
    'time-unit': '{name} counts 0, 1, 2, ..., which means {period:.3g} s per cycle: if it numbers the samples, name it '
    'time_samples and put a line "# sample_rate_hz: 100" above; if it counts milliseconds, name it time_ms',
    'too-few-cycles': 'the decay shows only {cycles:.1f} cycles, and two are needed to show how the damping depends on '
    'the amplitude: release from a larger angle, fit several trials jointly, or, if the craft is damped '
    'too strongly for more, choose an equation with linear damping',
    'too-few-waves': 'the {axis} holds {duration:.0f} s of motion in waves, whose spectrum peaks at {period:.3g} s: '
    'too few waves to separate hull and sea: record at least {needed:.0f} s, better three times as long',
    'too-few-waves: samples': 'the {axis} has only {samples} samples without a pause: give at least 10 minutes of '
    'motion in waves',
    'too-small': 'the decay starts with an amplitude of only {size:.2g} {unit}, where friction and the basin dominate '
    'the damping: release from 3 deg or more',
    'too-small: record': '{name} hardly moves ({reach} peak to peak): release the craft from 3 deg or more, and check '
    'that this is the axis that moved',
    'twist-in-world-axes': '{path}: the twist of the odometry is in world axes and was turned into body axes: publish '
    'it in child_frame_id, as nav_msgs/Odometry defines',
    'uncertain': '{name} {value:.3g} has a standard deviation of {std:.3g}: add {runs}',
    'unit-missing': 'columns without a unit were left out ({columns}): {unit_advice}',
    'unstable': 'the model is unstable at the speeds of its runs{where}: do not use it; add turns at several speeds',
    'viscous-scale-effect': 'Froude scaling keeps wave damping but not viscous damping: the Reynolds number changes by '
    'a factor {factor:.3g}, so the frictional part of {damping} will be {side} than scaled here; correct it with a '
    'friction line (ITTC 7.5-02-07-04.5) or confirm it at the other scale',
    'yaw-rate-derived': '{source} has no yaw rate: it was derived from the heading',
    'yaw-rate-reversed': '{source}: yaw rate and heading turn opposite ways (one in NED, one in ENU), so the yaw rate '
    'was reversed: give both in one frame',
}

#: What does it on the command line, by the code of an `Advice` or an `InputError`.
FLAGS = {
    'added-mass-diverges': '--fix m=KG',
    'axis-absent': '--axis, --column QUANTITY=NAME:UNIT',
    'columns-unknown': '--column QUANTITY=NAME:UNIT; in a manifest, columns:',
    'current-by-run': '--current shared',
    'decay-of-other-axis': '--axis',
    'disturbed-tail': '--end',
    'ends-in-warmup': '--until, --warmup',
    'forced-motion': '--at-sea, or --start and --end',
    'inertia-includes-added': '--inertia',
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
    'several-imu-topics': '--topic',
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
    'absurd-covariance': 'covariances beyond (half a turn)^2 or (35 rad/s)^2 were treated as unknown: have the driver '
    'send them in rad^2 and rad^2/s^2, or as zeros where they are unknown',
    'absurd-value': 'values that no craft reaches were left out: check that rates are rad/s and accelerations m/s^2',
    'bad-loading': 'a draft or displacement was not a positive number, and the previous one stays: check what '
    'publishes it',
    'bad-model': 'a model description could not be read, and the previous model stays: publish what '
    'swath-sysid identify writes',
    'bad-model-file': 'the model file cannot be used and is not overwritten: correct it or move it away, and restart '
    'the node',
    'bad-quaternion': 'invalid quaternions were left out, and the rates were used: if the sensor has no orientation, '
    'have the driver set orientation_covariance[0] to -1',
    'bad-upstream': 'upstream messages without a finite value, or with a repeated stamp, were left out: check their '
    'sensor',
    'bad-window': 'a motion window could not be read: publish what imu_buffer publishes',
    'clock-jumped-back': 'the clock was set back (a bag that looped?): window and filter state were restarted, hull '
    'and sea state are kept',
    'duplicate-stamp': 'samples with a repeated stamp were left out: if there are many, have the driver stamp its '
    'messages',
    'frame-id-changed': 'the frame_id of the messages changed: two sensors may share the topic, or the driver was '
    'reconfigured; give each sensor its own topic, and check whether the mounting is still right',
    'gap': 'samples are missing: check the load of the machine and of the network',
    'gap-too-long': 'the sensor was silent for a long time and resumed: check its driver and cable',
    'gate-restarted-pitch': 'the sensor contradicted the filter until the filter was restarted: identify again if this '
    'repeats',
    'gate-restarted-roll': 'the sensor contradicted the filter until the filter was restarted: identify again if this '
    'repeats',
    'identification-worker-died': 'the process that identifies died and was restarted: look for a lack of memory',
    'late-fit': 'a fit of the waves ended later than 0.5 s after its samples and was used only from then on, so '
    'forecasts differ a little from those of play-through: check the load of the machine if that matters',
    'loading-advice': 'the draft is outside the range of its model: see the log, and add trials at this draft',
    'model-not-saved': 'the model file could not be written: check model_path, its folder and its permissions',
    'near-vertical': 'samples with pitch beyond 80 deg, where roll and yaw cannot be distinguished, were left out: if '
    'the count keeps growing, the sensor is mounted on end: set mounting_deg to [0, 90, 0] or [0, -90, 0]',
    'no-orientation': 'the sensor gives no orientation, so only its rates are used',
    'no-rates': 'the sensor gives no rates, so forecasts are less certain, most of all in the first seconds: have the '
    'driver publish angular_velocity, if the sensor has it',
    'not-finite': 'NaN or infinite values were left out: check the driver',
    'nothing-usable': 'messages with nothing usable in them were left out: check the driver',
    'out-of-order': 'late samples were left out: check the transport, and look for a second publisher',
    'outlier-pitch': 'samples that contradict the forecast were rejected: look for shocks or magnetic disturbance',
    'outlier-roll': 'samples that contradict the forecast were rejected: look for shocks or magnetic disturbance',
    'passed-over': 'samples had waited in a queue: the filters used them, but forecasts were issued from newer ones '
    'only; check the load of the machine',
    'qos-mismatch': 'a publisher and a subscription have incompatible QoS and do not connect: compare both with ros2 '
    'topic info --verbose',
    'rate-changed': 'the sample rate changed, and the new one is used: check the driver if this was not intended',
    'sensor-silent': 'the sensor stopped publishing: check its driver and cable',
    'several-publishers': 'more than one node publishes the IMU topic: stop one, or remap them apart',
    'stray-stamp': 'single samples whose stamp is far from the others were left out: check the device that stamps them',
    'unknown-covariance': 'the sensor does not report its noise, which is therefore estimated',
    'wave-worker-died': 'the process that fits the waves died and was restarted: look for a lack of memory',
    'waves-not-fitted': 'the waves could not be fitted, and forecasts go on with the previous fit, or with none: see '
    'the log',
}

#: What to do about a state that is reported in /diagnostics but not counted.
STATES = {
    'clock-stands-still': 'the replay is paused, or nothing publishes /clock',
    'clocks-differ': 'synchronise the clocks, or replay with --clock and set use_sim_time',
    'messages-queued': 'they wait in a queue (check the load of the machine, the driver and the network), or a clock '
    'was set',
    'no-message-yet': 'check that the sensor publishes there, or remap the topic',
    'short-of-memory': 'samples come faster than max_rate_hz, which makes the window shorter: raise max_rate_hz',
}

CURES = {**REASONS, **STATES}


def with_flags(code: str, message: str) -> str:
    """A sentence with the flags, by its code, that do on the command line what it advises."""
    return f'{message} ({FLAGS[code]})' if code in FLAGS else message
