"""Two command lines for the help of each verb."""

EXAMPLES: dict[str, tuple[str, str]] = {
    'identify': (
        'identify decay.csv --axis roll --output model.yaml --plot fit.png',
        'identify decay.mat --column time=t:s --column roll=Phi:deg',
    ),
    'compare': (
        'compare roll_10deg.csv roll_6deg.csv --axis roll --output model.yaml',
        'compare decay.csv --equations linear,odd-cubic --json',
    ),
    'simulate': (
        'simulate --hull swath-roll --initial-angle-deg 8 --output decay.csv',
        'simulate --equation odd-cubic --axis pitch --initial-angle-deg 6 --output decay.mcap --seed 3',
    ),
    'campaign': ('campaign --new trials', 'campaign trials/campaign.yaml --output report'),
    'paper': ('paper swath-pitch', 'paper swath-roll --output swath_roll.html --jobs 2'),
    'scale': ('scale model.yaml --ratio 25 --output ship.yaml', 'scale ship.yaml --ratio 1/25 --output tank.yaml'),
    'manoeuvre': (
        'manoeuvre identify zigzag_10.csv zigzag_20.csv --output craft.yaml',
        'manoeuvre simulate --model craft.yaml --test turning-circle --plot circle.png',
    ),
    'export': ('export craft.yaml --to gazebo --output craft.sdf', 'export craft.yaml --to fossen --language matlab'),
    'forecast': (
        'forecast morro_buoy.csv --frame frd --leads 0.5,1,2',
        'forecast run.mcap --model model.yaml --point deck:2,0,1.5 --json',
    ),
    'sea': ('sea morro_buoy.csv --frame frd --plot sea.png', 'sea run.mcap --start 60 --end 1260 --json'),
    'inspect': ('inspect decay.csv --plot record.png', 'inspect run_12.tdms --column roll=Phi:deg'),
    'play-through': (
        'play-through morro_buoy.mcap --output forecasts.mcap',
        'play-through run.mcap --model model.yaml --params params.yaml --output forecasts.mcap',
    ),
    'run': ('run --imu-topic /sensors/imu --model model.yaml --page', 'run --list'),
    'page': ('page', 'page --namespace craft --port 8090'),
    'replay': ('replay morro_buoy.mcap --clock', 'replay morro_buoy.mcap --rate 4'),
    'record': ('record --output run.mcap', 'record --topic /sensors/gnss'),
    'demo': ('demo --output out', 'demo --output out --hull swath-pitch'),
}


def examples_of(verb: str) -> str:
    """The examples as the help shows them."""
    return '\n'.join(['examples:', *(f'  swath-sysid {line}' for line in EXAMPLES[verb])])
