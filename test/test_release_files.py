"""What a release has beside the code: one version, a changelog that ROS tools read, the fields for its owner."""

import re
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import yaml

import swath_sysid

ROOT = Path(__file__).resolve().parents[1]
PLACEHOLDER = 'swath-sysid.example'
READ_BY_USERS = ['CITATION.cff', 'SECURITY.md', 'QUALITY_DECLARATION.md', 'CHANGELOG.rst', 'package.xml', 'setup.py']


def text_of(name):
    """A file of the repository."""
    return (ROOT / name).read_text(encoding='utf-8')


def test_the_citation_is_of_this_version():
    citation = yaml.safe_load(text_of('CITATION.cff'))
    assert {'cff-version', 'message', 'title', 'authors'} <= set(citation)
    assert (citation['version'], citation['license']) == (swath_sysid.__version__, 'Apache-2.0')


def test_the_changelog_is_as_rep_132_asks():
    """Its title, and sections that are ``Forthcoming`` or ``1.2.3 (2027-01-31)``, newest first."""
    lines = text_of('CHANGELOG.rst').splitlines()
    assert lines[1] == 'Changelog for package swath_sysid'
    headings = [lines[k - 1] for k, line in enumerate(lines) if k > 2 and re.fullmatch('-{3,}', line)]
    assert headings
    released = [re.fullmatch(r'(\d+\.\d+\.\d+) \(\d{4}-\d\d-\d\d\)', heading) for heading in headings]
    assert all(released[1:]) and (released[0] or headings[0] == 'Forthcoming')
    prepared = re.search(r'Prepared as (\S+),', text_of('CHANGELOG.rst'))
    newest = (released[0] or prepared).group(1)
    assert newest == swath_sysid.__version__


def test_every_placeholder_is_listed_for_the_owner():
    listed = text_of('docs/releasing.md').split('## A release')[0]
    holding = [name for name in READ_BY_USERS if PLACEHOLDER in text_of(name)]
    assert holding == [name for name in READ_BY_USERS if f'`{name}`' in listed.split('Beside these')[0]]


def test_the_manifest_says_where_things_are():
    urls = ElementTree.parse(ROOT / 'package.xml').getroot().findall('url')
    assert {url.get('type') for url in urls} == {'website', 'repository', 'bugtracker'}
    assert all(url.text.startswith('https://') for url in urls)


def test_the_hosted_ci_runs_both_pythons_and_a_jazzy_container():
    jobs = yaml.safe_load(text_of('.github/workflows/ci.yml'))['jobs']
    assert jobs['pip']['strategy']['matrix']['python'] == ['3.11', '3.12']
    assert jobs['colcon']['container'].startswith('ros:jazzy')
    for job in jobs.values():
        for step in job['steps']:
            if 'run' in step:
                subprocess.run(['bash', '-n'], input=step['run'], text=True, check=True)
