"""Completion of verbs, flags and their choices in bash and zsh."""

import argparse
from argparse import ArgumentParser
from collections.abc import Mapping

SCRIPT = """\
# for bash and zsh: eval "$(swath-sysid --completion)"
[ -z "$ZSH_VERSION" ] || {{ autoload -U +X compinit && compinit; autoload -U +X bashcompinit && bashcompinit; }}
_swath_sysid() {{
  local words
  case "${{COMP_WORDS[1]}} ${{COMP_WORDS[COMP_CWORD-1]}}" in
{cases}
    *) words="" ;;
  esac
  [ "$COMP_CWORD" -gt 1 ] || words="{verbs}"
  COMPREPLY=($(compgen -W "$words" -- "${{COMP_WORDS[COMP_CWORD]}}"))
}}
complete -o default -F _swath_sysid swath-sysid"""


def completion_script(verbs: Mapping[str, ArgumentParser]) -> str:
    """The script, from the parsers of the verbs; a word that it does not know is a file name."""
    cases = []
    for verb, parser in verbs.items():
        words: list[str] = []
        for action in actions_of(parser):
            words += action.option_strings
            if action.choices and not action.option_strings:
                words += action.choices
            elif action.choices:
                given = '|'.join(f'"{verb} {flag}"' for flag in action.option_strings)
                cases.append(f'    {given}) words="{" ".join(action.choices)}" ;;')
        cases.append(f'    "{verb} "*) words="{" ".join(dict.fromkeys(words))}" ;;')
    return SCRIPT.format(cases='\n'.join(cases), verbs=' '.join([*verbs, '--help', '--version']))


def actions_of(parser: ArgumentParser) -> list[argparse.Action]:
    """The arguments of a parser and of its sub-verbs."""
    actions = list(parser._actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            actions += [each for sub in action.choices.values() for each in actions_of(sub)]
    return actions
