#!/bin/sh
# The procedure of a free-running identification, on a simulated WAM-V 16, in one command:
#   examples/manoeuvring_wamv.sh [FOLDER] [NAME=VALUE ...]
# Straight runs, turns and zig-zags are simulated with sensor noise; a fit to two thirds of them is validated on
# the others, and the model is identified from all; its turning circle is compared with that of the craft that made the runs.
# With arguments such as  dead_band=0.05 lag=0.3  the craft is driven by normalised commands instead of thrust in N.
set -e
folder=${1:-manoeuvring_wamv}
[ $# -eq 0 ] || shift
program=${SWATH_SYSID:-swath-sysid}

mkdir -p "$folder"
echo '1. acquire: runs of 15 min in all'
if [ $# -gt 0 ]; then
    $program manoeuvre simulate --hull wamv-vrx-old --test programme --output "$folder/runs" --command "$@"
else
    $program manoeuvre simulate --hull wamv-vrx-old --test programme --output "$folder/runs"
fi

echo '2. identify and validate (pictures in plots/)'
$program manoeuvre identify "$folder"/runs/*.csv --mass 180 --output "$folder/model.yaml" --plot "$folder/plots"

echo '3. forecast the zig-zag with the thrust to come known'
$program manoeuvre forecast "$folder/runs/zigzag_20.csv" --train "$folder/runs/mixed.csv" "$folder/runs/turns_fast.csv" \
    --model "$folder/model.yaml" --future supplied --plot "$folder/forecast.png"

echo '4. turning circle of the model, and of the craft'
$program manoeuvre simulate --model "$folder/model.yaml" --test turning-circle --plot "$folder/turning_circle.png"
[ $# -gt 0 ] || $program manoeuvre simulate --hull wamv-vrx-old --test turning-circle
