"""``axialnav VERB ...``: verbs, exit codes and one-line errors.

Exit codes: 0 passed, 1 a check failed, 2 usage error, 3 nothing evaluated or input not usable, 130 interrupted.
``axialnav`` alone prints the help and is a usage error too: a script whose verb went missing must not look like
success.  An error is one line on stderr, never a traceback; ``AXIALNAV_DEBUG=1`` in the environment shows the traceback
to whoever looks for it.

Only the command line prints.  Verbs import what they need when they run, so that ``axialnav --help`` stays fast.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

from cyclopts import App, Parameter
from cyclopts.exceptions import CycloptsError

from axialnav.fusion.complaints import INTERRUPTED, PASSED, USAGE, complain, explain, shows_tracebacks
from axialnav.fusion.live import cli as on_board
from axialnav.replay.cli_calibrate import allan, calibrate
from axialnav.replay.cli_check import check, compare
from axialnav.replay.cli_convert import convert
from axialnav.replay.cli_doctor import doctor
from axialnav.replay.cli_output import emit
from axialnav.replay.cli_replay import demo, replay
from axialnav.replay.cli_simulate import simulate
from axialnav.replay.cli_sweep import sweep
from axialnav.replay.cli_tune import tune
from axialnav.replay.motion_cli import motion_command

VERBS: dict[str, Callable[..., int]] = {
    "demo": demo,
    "simulate": simulate,
    "doctor": doctor,
    "replay": replay,
    "motion": motion_command,
    "check": check,
    "compare": compare,
    "convert": convert,
    "tune": tune,
    "calibrate": calibrate,
    "allan": allan,
    "sweep": sweep,
}
HELP = """Axial velocity of a UAV in a featureless tunnel, with an honest uncertainty.

Exit codes: 0 passed, 1 a check failed, 2 usage error, 3 nothing evaluated or input not usable.
"""


def _version() -> str:
    import axialnav

    return str(axialnav.__version__)


def build_app() -> App:
    """The command line as a value: one command per verb, none of them loaded yet."""
    app = App(
        name="axialnav",
        help=HELP,
        version=_version,
        help_format="plaintext",
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    for name, verb in VERBS.items():
        app.command(verb, name=name)
    for name, purpose in on_board.VERBS.items():
        app.command(_forward(name), name=name, help=purpose, help_flags=(), version_flags=())
    return app


def _forward(verb: str) -> Callable[..., int]:
    """A verb that flies, whose own parser needs none of the libraries of this one."""

    def run(*words: Annotated[str, Parameter(allow_leading_hyphen=True)]) -> int:
        """Hand the words to the parser of the verb; its help is the verb's purpose, not this."""
        return on_board.main([verb, *words])

    return run


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return its exit code; ``arguments`` default to those of the process."""
    tokens = list(sys.argv[1:] if arguments is None else arguments)
    app = build_app()
    try:
        if not tokens:
            app.help_print([])
            return USAGE
        result = _run(app, tokens)
        emit()
        return result
    except KeyboardInterrupt:
        complain("interrupted; files written so far may be incomplete")
        return INTERRUPTED
    except Exception as error:  # the last line of defence: a person gets one line, not a traceback
        if shows_tracebacks():
            raise
        return _explain(error)


def _run(app: App, tokens: list[str]) -> int:
    result: Any = app(tokens, exit_on_error=False, print_error=False)
    return result if isinstance(result, int) else PASSED


def _explain(error: Exception) -> int:
    """Put an error into one line on stderr and choose the exit code."""
    if isinstance(error, CycloptsError):
        complain(f"{_usage_text(error)} See `axialnav --help`.")
        return USAGE
    text, code = explain(error)
    complain(text)
    return code


def _usage_text(error: CycloptsError) -> str:
    text = str(error).strip()
    return text if text.endswith((".", "?", "!")) else f"{text}."
