"""Draws the pictures of the tutorials with the commands that they show: `python docs/draw_tutorials.py` (3 min)."""

import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve().parent
BUOY = 'forecast records/morro_buoy.csv --leads 0.5,1,2,3 --warmup 180'
RUNS = 'runs/speed_up.csv runs/turns_fast.csv runs/zigzag_20.csv'
RELEASES = [
    f'simulate --hull swath-roll --initial-angle-deg {angle} --seed {angle}{repeat} '
    f'--output trials/roll_{angle}deg_1.0T_repeat{repeat}.csv'
    for angle in (4, 8)
    for repeat in (1, 2)
]
#: by tutorial, its commands, and the pictures that they make with the names that the site gives them
PICTURES = {
    'first_record': (
        ['identify records/kvlcc2_roll_decay.csv --axis roll --plot fit.png', f'{BUOY} --plot sea.png'],
        {'fit.png': 'tutorials/first_record_fit.png', 'sea.png': 'forecast.png'},
    ),
    'own_imu': (
        ['forecast records/morro_buoy.mcap --axis roll --leads 0.5,1,2 --warmup 60 --until 180 --plot skill.png'],
        {'skill.png': 'tutorials/own_imu_skill.png'},
    ),
    'tank_trial': (
        [*RELEASES, 'campaign --new trials/', 'campaign trials/campaign.yaml --output report/'],
        {'report/figures/decays_roll_all.svg': 'tutorials/tank_trial_decays.svg'},
    ),
    'manoeuvring': (
        [
            'manoeuvre simulate --hull wamv-vrx-old --test programme --output runs/',
            f'manoeuvre identify {RUNS} --mass 180 --output craft.yaml --plot plots/',
        ],
        {'plots/validation_01_turns_fast.png': 'tutorials/manoeuvring_validation.png'},
    ),
}


def draw(folder, commands, pictures):
    """Carry out commands in a folder and keep their pictures; 64 colours make them small."""
    (folder / 'records').symlink_to(HERE.parent / 'records')
    (folder / 'trials').mkdir()
    for command in commands:
        print(f'swath-sysid {command}', flush=True)
        subprocess.run([sys.executable, '-m', 'swath_sysid.cli.main', *command.split()], cwd=folder, check=False)
    print(sorted(path.relative_to(folder).as_posix() for path in folder.rglob('*.[ps][nv]g')))
    for made, kept in pictures.items():
        if made.endswith('.svg'):
            (HERE / kept).write_bytes((folder / made).read_bytes())
        else:
            Image.open(folder / made).convert('RGB').quantize(64).save(HERE / kept, optimize=True)


if __name__ == '__main__':
    for name in sys.argv[1:] or PICTURES:
        with tempfile.TemporaryDirectory() as made_in:
            draw(Path(made_in), *PICTURES[name])
