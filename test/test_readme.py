"""The README says what is true: its generated tables are those of the code, and every verb is in it.

``python test/test_readme.py`` writes the generated parts anew.
"""
import re
from pathlib import Path

from swath_sysid.attitude.hull.catalogue import PUBLISHED_HULLS
from swath_sysid.attitude.identification.search import PRESETS
from swath_sysid.cli.main import VERBS
from swath_sysid.nodes.parameters.files import NODES, markdown_table
from swath_sysid.nodes.reason_advice import reasons_table

README = Path(__file__).resolve().parents[1] / 'README.md'


def parameters():
    """The parameters of every node."""
    return '\n'.join(f'### {node}\n\n{markdown_table(node)}' for node in NODES).rstrip()


GENERATED = {'diagnostics': lambda: reasons_table().rstrip(), 'parameters': parameters}


def written_anew(text):
    """The README with its generated parts from the code."""
    for name, make in GENERATED.items():
        block = f'<!-- {name} -->\n\n{make()}\n\n<!-- end of {name} -->'
        pattern = rf'<!-- {name} -->(?:.*?<!-- end of {name} -->)?'
        text = re.sub(pattern, lambda _, block=block: block, text, flags=re.DOTALL)
    return text


def test_generated_tables_are_those_of_the_code():
    text = README.read_text(encoding='utf-8')
    assert text == written_anew(text), 'run: python test/test_readme.py'


def test_every_verb_and_name_is_explained():
    text = README.read_text(encoding='utf-8')
    absent = [name for name in (*VERBS, *PUBLISHED_HULLS, *PRESETS) if name not in text]
    assert not absent


def test_linked_files_exist():
    links = re.findall(r'\]\(([^)#:]+)\)', README.read_text(encoding='utf-8'))
    assert links
    assert [link for link in links if not (README.parent / link).exists()] == []


if __name__ == '__main__':
    README.write_text(written_anew(README.read_text(encoding='utf-8')), encoding='utf-8')
