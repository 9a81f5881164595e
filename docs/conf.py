"""The site: `sphinx-build -W docs out/site`, or rosdoc2. Its reference is generated from the code (docs/generated).

Nothing of it is loaded from another host: fonts are the reader's own, and formulas are MathML, made at build time.
"""

import os
import re
import sys
from importlib import import_module
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
os.environ['COLUMNS'] = '100'

import swath_sysid  # noqa: E402
from swath_sysid.cli.main import VERBS, build_parser  # noqa: E402
from swath_sysid.common.advice import FLAGS, SENTENCES  # noqa: E402
from swath_sysid.common.conditions import GROUPS  # noqa: E402
from swath_sysid.formats.registry import TANK  # noqa: E402
from swath_sysid.formats.vocabulary import MOTION_QUANTITIES  # noqa: E402
from swath_sysid.nodes.parameters.parameter_files import yaml_value  # noqa: E402
from swath_sysid.nodes.parameters.table import NODES, table_of  # noqa: E402

project = 'swath_sysid'
author = copyright = 'The swath_sysid maintainers'
version = release = swath_sysid.__version__
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon', 'sphinx_copybutton']
exclude_patterns = ['generated/parts']
# the wings have the same names inside: Run, Scales, heading
suppress_warnings = ['ref.python']
html_theme = 'furo'
html_title = f'swath_sysid {release}'
html_static_path = ['static']
html_css_files = ['site.css']
html_math_renderer = 'mathml'
copybutton_prompt_text = '>>> |... '
copybutton_prompt_is_regexp = True
html_show_sphinx = False
myst_heading_anchors = 3
myst_enable_extensions = ['dollarmath']
autodoc_member_order = 'bysource'
autodoc_default_options = {'members': True, 'undoc-members': True}
autodoc_typehints = 'signature'
autodoc_class_signature = 'separated'
napoleon_google_docstring = True
napoleon_use_rtype = False
napoleon_use_ivar = True


_comments = {}


def keep_comment(app, what, name, obj, options, lines):
    """A field's comment, which napoleon would take for a type up to its first colon; ``s.`` does not begin a list."""
    if what in ('attribute', 'property'):
        _comments[name] = [re.sub(r'^(\w\.)', r'\\\1', line) for line in lines]


def restore_comment(app, what, name, obj, options, lines):
    """The comment as it was written."""
    lines[:] = _comments.pop(name, lines)


def mathml(translator, node):
    """A formula as MathML, which browsers show without a script."""
    from docutils.nodes import SkipNode, math
    from latex2mathml.converter import convert

    if isinstance(node, math):
        translator.body.append(convert(node.astext()))
    else:
        translator.body.append(f'<div class="formula" tabindex="0">{convert(node.astext(), display="block")}</div>')
    raise SkipNode


#: Where a name in code may break: after a mark that is not in a tag.
NAME = re.compile(r'(?<=[\w~])([/_.=])(?=\w[^<>]*</span>)')


def accessible(app, pagename, templatename, context, doctree):
    """Captions of the contents are headings of a level, wide blocks scroll by keys, names in tables break."""
    body = context.get('body', '').replace('<pre>', '<pre tabindex="0">')
    context['body'] = re.sub(r'<td>.*?</td>', lambda cell: NAME.sub(r'\1<wbr>', cell[0]), body, flags=re.DOTALL)
    tree = context.get('furo_navigation_tree', '')
    context['furo_navigation_tree'] = tree.replace('role="heading"', 'role="heading" aria-level="2"')


def setup(app):
    """Napoleon's own handler has the priority 500, the theme's of a page too."""
    app.connect('html-page-context', accessible, priority=900)
    app.add_html_math_renderer('mathml', (mathml, None), (mathml, None))
    app.connect('autodoc-process-docstring', keep_comment, priority=400)
    app.connect('autodoc-process-docstring', restore_comment, priority=600)


def write(name, text):
    """A generated page, left alone where it is the same, so that a second build is quick."""
    path = HERE / 'generated' / name
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists() or path.read_text(encoding='utf-8') != text:
        path.write_text(text, encoding='utf-8')


def commands():
    """Every verb's own help."""
    texts = ['# Commands', '', 'As each prints it with `--help`.', '']
    for verb in VERBS:
        parser = build_parser(verb)._subparsers._group_actions[0].choices[verb]
        texts += [f'## {verb}', '', '```text', parser.format_help().rstrip(), '```', '']
    return '\n'.join(texts)


def markdown_table(node_name):
    """The parameters of a node, as the parameter file names it, as a Markdown table."""
    lines = ['| Parameter | Default | Range | Unit | Meaning |', '|---|---|---|---|---|']
    for p in table_of(node_name):
        fixed = '' if not p.read_only else ' (set at the start)'
        meaning = f'{p.meaning}{fixed}'.replace('|', '\\|')
        lines.append(f'| `{p.name}` | `{yaml_value(p.default)}` | {p.allowed} | {p.unit} | {meaning} |')
    return '\n'.join(lines) + '\n'


def parameters():
    """The tables of the nodes' parameters."""
    head = 'The defaults are in `config/swath_sysid.yaml`; those for small computers in `config/small.yaml`.'
    return f'# Parameters\n\n{head}\n\n' + '\n\n'.join(f'## {node}\n\n{markdown_table(node)}' for node in NODES)


def in_words(sentence):
    """A sentence for a table of Markdown; its values are in italics by name."""
    return re.sub(r'{(\w+)[^}]*}', lambda value: f'*{value[1].replace("_", " ")}*', sentence.replace('|', '\\|'))


#: When a condition is warned of, by `ConditionRow.warns`.
WARNED = {
    'always': 'whenever its count grows',
    'recurring': 'from the second report in a row',
    'once': 'once, then reported while it lasts',
    'never': 'never',
}


def conditions_table():
    """Every condition of /diagnostics by its code, as a Markdown table."""
    rows = []
    for group, conditions in GROUPS.items():
        for code, each in conditions.items():
            text = in_words(': '.join(filter(None, (each.sentence, each.cure))))
            warned = 'while it holds' if group.endswith('states') else WARNED[each.warns]
            warned += f', not while `{each.unless}` grows' if each.unless else ''
            rows.append(f'| `{code}` | {each.level} | {text} | {warned} |')
    head = ['| code | level | what it means, and what to do | warned of |', '|---|---|---|---|']
    return '\n'.join([*head, *sorted(set(rows))]) + '\n'


def tank_formats():
    """How each format of data acquisition is read, as its reader says, as a Markdown table."""
    rows = ['| file | library | how it is read |', '|---|---|---|']
    for each in TANK:
        _, said = import_module(f'swath_sysid.formats.tank.{each.module}').__doc__.split('\n\n')
        how = ' '.join(said.replace('``', '`').split())
        rows.append(f'| `{each.ending}`, {each.what} | {each.library} | {how} |')
    return '\n'.join(rows) + '\n'


def column_names():
    """The further names that a column may have, as a Markdown table."""
    rows = [f'| {q.reading} | {", ".join(f"`{name}`" for name in q.also)} |' for q in MOTION_QUANTITIES if q.also]
    return '\n'.join(['| quantity | further names |', '|---|---|', *rows]) + '\n'


def warnings_table():
    """Every warning with its sentences and flags, as a Markdown table."""
    sentences: dict[str, list[str]] = {}
    for key, sentence in SENTENCES.items():
        sentences.setdefault(key.partition(':')[0], []).append(in_words(sentence))
    flags = {code: f'`{words.format("ROLL,PITCH,YAW")}`' for code, words in FLAGS.items()}
    rows = [f'| `{code}` | {"<br>".join(texts)} | {flags.get(code, "")} |' for code, texts in sentences.items()]
    return '\n'.join(['| code | what it says | on the command line |', '|---|---|---|', *rows]) + '\n'


write('commands.md', commands())
write('parameters.md', parameters())
write('parts/conditions.md', conditions_table())
write('parts/tank_formats.md', tank_formats())
write('parts/column_names.md', column_names())
write('parts/warnings.md', warnings_table())
