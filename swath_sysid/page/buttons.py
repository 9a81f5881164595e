"""The buttons of the page: what each does, and why it is disabled."""

from swath_sysid.attitude.identification.fit_quality import REJECTED
from swath_sysid.page.bring_up import IDENTIFICATION, Facts
from swath_sysid.page.model_words import described, verdict_of

#: Label and meaning.
BUTTONS = {
    'identify': ('Identify', 'fit a model to the last minute of motion now'),
    'accept': ('Accept', 'keep this model: further motion is not fitted by itself any more'),
    'save': ('Save', 'write the model to a file on the machine of the page'),
    'restart': ('Release again', 'start again with the rest before a push'),
    'refine': ('Refine', 'let further releases refine the model again'),
    'rollback': ('Rollback', 'return to the previous model; asks first'),
    'record': ('Record', 'write every topic to a bag on the machine of the page; once more ends it'),
}

NO_MODEL = 'there is no model yet: release the craft first'


def refusals(facts: Facts) -> dict[str, str]:
    """Why buttons are disabled, by name; enabled ones are absent."""
    is_there, model = IDENTIFICATION in facts.statuses, facts.model
    busy = '' if is_there else 'the identifier does not answer: start the nodes with swath-sysid run'
    if facts.is_identifying:
        busy = 'an identification is running'
    reasons = {
        'identify': busy or ('' if facts.motions or facts.silence < float('inf') else 'no motion was measured yet'),
        'accept': NO_MODEL if model is None else 'this model is kept already' if facts.is_kept else busy,
        'refine': '' if facts.is_kept else 'releases refine the model as it is',
        'save': NO_MODEL if model is None else '',
        'rollback': busy
        or ('' if facts.value(IDENTIFICATION, 'rollbacks_kept') else 'the identifier holds no model before this one'),
    }
    if model is not None and verdict_of(model)[0] == REJECTED:
        reasons['accept'] = ': '.join(verdict_of(model))
    return {name: reason for name, reason in reasons.items() if reason}


def rollback_question(facts: Facts, folder: str) -> str:
    """The question before the present model is replaced."""
    goes = '' if facts.model is None else f' {described(facts.model)} goes.'
    last = facts.value(IDENTIFICATION, 'rollbacks_kept') <= 1.0
    left = ' No other model is kept: forecasts may then do without one.' if last else ''
    return f'Return to the previous model?{goes}{left} The current model is saved first, in {folder}.'
