"""What the lines above a table, or the cells above that of a sheet, say of a trial: only numbers with a unit."""

import re
from pathlib import Path

from swath_sysid.common.errors import InputError
from swath_sysid.formats.table_files import first_rows
from swath_sysid.tank.campaign.manifest import NUMBER
from swath_sysid.tank.campaign.names import LENGTHS, SPEEDS

LINES_ABOVE = 4096  #: Bytes in which lines above a table are looked for.
#: Key of an entry to the words before its number in a line above a table, and the units that may follow it.
_IN_LINES = {
    'draft_m': ('draft|draught|tiefgang', LENGTHS),
    'displacement_kg': ('displacement|verdrängung|masse?', {'kg': 1.0, 't': 1e3}),
    'speed_m_s': ('speed|velocity|geschwindigkeit', SPEEDS | {'cm/s': 1e-2}),
    'initial_angle_deg': (r'(?:\w* )?\w*(?:angle|winkel)', {'deg': 1.0, '°': 1.0, 'grad': 1.0}),
}
_BETWEEN = r'[ "]*[:=;,\t][ :=;,\t"]*'
_LOAD_CASE = re.compile(
    r'(?:^|[;,\t])\W*(?:load(?:ing)?[ _-](?:case|condition)|beladung(?:sfall|szustand)?|ladefall)'
    rf'{_BETWEEN}([^;\t\n"]{{1,40}})',
    re.IGNORECASE | re.MULTILINE,
)


def said_above(path: Path) -> tuple[dict[str, float], str]:
    """Draft, displacement, speed and angle as lines above a table of text or cells of a sheet say them; load case."""
    text = text_above(path)
    found = {}
    for key, (words, units) in _IN_LINES.items():
        unit = '|'.join(sorted(map(re.escape, units), key=len, reverse=True))
        line = (
            rf'(?:^|[;,\t])\W*(?:(?:mean|mittlerer|model) )?(?:{words})[ _]*[\[(]?(?P<first>{unit})?[\])]?'
            rf'{_BETWEEN}(?:(?P<before>{unit}){_BETWEEN})?(?P<n>{NUMBER})[ ;,\t"\[(]*(?P<then>{unit})?(?!\w)'
        )
        if match := re.search(line, text, re.IGNORECASE | re.MULTILINE):
            given = (match['first'] or match['before'] or match['then'] or '').lower()
            value = float(f'{float(match["n"].replace(",", ".")) * units.get(given, 1.0):.9g}')
            if given and (value > 0.0 or key == 'speed_m_s'):
                found[key] = value
    case = _LOAD_CASE.search(text)
    return found, case[1].strip(' ,') if case else ''


def text_above(path: Path) -> str:
    """The first lines of a text, or of the sheets of a workbook with its cells apart."""
    with open(path, 'rb') as file:
        raw = file.read(LINES_ABOVE)
    if raw.startswith(b'PK') and path.suffix.lower() == '.xlsx':
        try:
            rows = first_rows(path)
        except InputError:
            return ''  # which reading the trial tells
        return '\n'.join(';'.join('' if cell is None else str(cell) for cell in row) for row in rows)
    return raw.decode('utf-8' if b'\xc2' in raw or b'\xc3' in raw else 'latin-1', errors='ignore')
