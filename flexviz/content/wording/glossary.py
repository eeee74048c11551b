"""The glossary: what the terms of pages and reports mean, and where a text first uses one."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from flexviz.content.wording.numbers import escape


@dataclass(frozen=True)
class Term:
    """A term and its explanation in one or two sentences.

    Attributes:
        name: as the glossary lists it.
        text: the explanation, plain text.
        forms: regular expression of its appearances in texts; empty: the name alone.
    """

    name: str
    text: str
    forms: str = ""


GLOSSARY = (
    Term(
        "residual",
        "Measured torque minus the torque of the model; of joints that follow goals, simulated minus "
        "measured angle.",
        r"[Rr]esiduals?",
    ),
    Term(
        "% of the torque",
        "The size of an error: rms residual ÷ standard deviation of the joint's recorded torque over all "
        "groups, which no model changes.",
        r"% of (?:the|its) torque",
    ),
    Term(
        "% of the following error",
        "The size of an error of joints that follow goals: rms of simulated minus measured angle ÷ standard "
        "deviation of goal minus position.",
        r"% of (?:the|its) following error",
    ),
    Term(
        "noise",
        "The rms residual that the sensors' noise alone would leave, the same for all models. An error as "
        "small as that leaves nothing to explain.",
        r"[Nn]oise(?! gain)(?: floor)?",
    ),
    Term("rms", "Root mean square: the typical size of a signal.", r"[Rr]ms"),
    Term(
        "validation",
        "Held-out groups: they are not fitted, so their error tells how well the model predicts a motion "
        "that it has not seen.",
        r"[Vv]alidat(?:ion|es)|[Hh]eld[- ]out",
    ),
    Term("payload", "A body of known mass that is fixed to a link.", r"[Pp]ayloads?"),
    Term("K", "Stiffness of the joint [Nm/rad]: torque per radian of deflection."),
    Term("kp", "Gain of a servo's position control [Nm/rad]: torque per radian of goal minus position."),
    Term("B", "Motor inertia [kg m²], reflected to the joint (times the gear ratio squared)."),
    Term("f_lv", "Viscous friction on the link side [Nm s/rad]."),
    Term("f_mv", "Viscous friction on the motor side, reflected to the joint [Nm s/rad]."),
    Term(
        "f_lv+f_mv",
        "Both viscous frictions together: a stiff gear lets the data determine only their sum.",
        r"f_lv\+f_mv",
    ),
    Term(
        "deflection",
        "Motor angle θ minus link angle q: how far the gear is twisted.",
        r"[Dd]eflections?|θ − q",
    ),
    Term("τ", "Motor torque, reflected to the joint (times the gear ratio) [Nm]."),
    Term(
        "ESO",
        "Extended state observer: estimates the derivatives of the motor angle and a disturbance from the "
        "recording, in real time.",
        "ESO",
    ),
    Term(
        "bandwidth",
        "Motion faster than this is smoothed away, and noise with it [rad/s].",
        r"[Bb]andwidths?",
    ),
    Term("lag", "How late the observer's derivatives follow the motion.", r"[Ll]ag"),
    Term(
        "noise gain",
        "How much of the noise of a measured angle reaches its k-th derivative.",
        r"[Nn]oise gain",
    ),
    Term(
        "zero phase",
        "Filtered forward and backward: no delay, but only for a finished recording.",
        r"zero[- ]phase",
    ),
    Term(
        "transients",
        "The start and end of a recording, where a filter has not settled.",
        r"[Tt]ransients?",
    ),
    Term(
        "disturbance",
        "State of an observer such as the ESO: what its own model of the motion leaves out.",
        r"[Dd]isturbance",
    ),
    Term(
        "± 95 %",
        "With a probability of 95 % the true value is within this distance, noise and effects that may be "
        "missing considered.",
        r"± 95 %",
    ),
    Term(
        "identifiable",
        "Yes: these data determine the value. Weak: its 95 % interval is wide. No: the data leave it open, "
        "and it has no interval.",
        r"[Ii]dentifiable|id\.",
    ),
    Term(
        "inertial combinations",
        "Base parameters: masses and inertias act only in certain sums, and a motion determines only these.",
        r"[Ii]nertial combinations?|[Bb]ase parameters?|combinations?",
    ),
    Term(
        "first moment",
        "Mass times the distance of the centre of mass along an axis of the link [kg m].",
        r"[Ff]irst moments?",
    ),
    Term(
        "condition number",
        "How unequally the data determine the parameters; far above 1000 some of them hardly matter.",
        r"[Cc]ondition number",
    ),
    Term("Refine", "A second fit, which corrects the bias that the observer's smoothing leaves.", "Refine"),
    Term(
        "confidence",
        "Probability that this effect, or one that looks the same in these data, is the right one.",
        r"[Cc]onfidence",
    ),
    Term(
        "free curve",
        "A curve through the residual of one joint against one variable. It lowers the error, but is not "
        "physics.",
        r"[Ff]ree curves?",
    ),
    Term(
        "absorbed",
        "Without the effect the fit distorts other parameters to make up for it; the arrow leads to their "
        "values with it.",
        "absorbed",
    ),
    Term(
        "structured residual",
        "The part of the residual that follows the motion; noise does not.",
        r"[Ss]tructured residual",
    ),
    Term(
        "out of sample",
        "Judged on data that were not used to find the curve, so that noise scores 0 %.",
        r"[Oo]ut of sample",
    ),
    Term(
        "nats",
        "Unit of the search's objective, the logarithm of a probability: 3 nats are a factor of 20.",
        "nats?",
    ),
    Term(
        "decoy",
        "A candidate that cannot be right, such as the friction of another joint. It shows how easily the "
        "search is deceived by these data.",
        r"[Dd]ecoys?",
    ),
)
"""The terms, those that a page shows first at the beginning; `docs/glossary.md` lists the same ones."""

SILENT = ("a", "abbr", "button", "code", "h1", "h2", "h3", "pre", "s", "script", "style", "summary", "svg")
"""HTML elements in which no term is explained: headings, and what is pressed, copied or drawn."""

_PIECES = re.compile(r"<[^>]*>|[^<]+")
_FORMS = re.compile(
    r"(?<![\w/+·.:-])(?:"
    + "|".join(
        f"(?P<t{k}>{term.forms or re.escape(term.name)})"
        for k, term in sorted(enumerate(GLOSSARY), key=lambda one: -len(one[1].forms or one[1].name))
    )
    + r")(?![\w/+:-]|\.\w)"
)


def with_terms(html: str, focus: bool = False, known: set[str] | None = None) -> str:
    """HTML in which the first appearance of each term carries its explanation, for a pointer and a reader.

    Args:
        html: a text of a page, made by the view; only text between tags is marked.
        focus: whether the keyboard reaches the terms; on a page with a script, the script decides that.
        known: names of terms that are explained already; the ones found here are added.
    """
    known = set() if known is None else known
    found, out = _marked(html, focus, frozenset(known))
    known |= found
    return out


@lru_cache(maxsize=512)
def _marked(html: str, focus: bool, known: frozenset[str]) -> tuple[frozenset[str], str]:
    done = set(known)
    out = "".join(_pieces(html, focus, done))
    return frozenset(done), out


def _pieces(html: str, focus: bool, done: set[str]) -> Iterator[str]:
    """The HTML tag by tag and text by text, the texts with their terms marked."""
    reach = ' tabindex="0"' if focus else ""

    def mark(found: re.Match[str]) -> str:
        term = GLOSSARY[int((found.lastgroup or "t0")[1:])]
        if term.name in done:
            return found[0]
        done.add(term.name)
        return f'<abbr class="fv-term"{reach} title="{escape(term.text)}">{found[0]}</abbr>'

    silent: list[str] = []
    for piece in _PIECES.findall(html):
        if not piece.startswith("<"):
            yield piece if silent else _FORMS.sub(mark, piece)
            continue
        name = re.match(r"</?([a-z0-9]*)", piece)
        if name and name[1] in SILENT and not piece.endswith("/>"):
            if piece.startswith("</"):
                silent = silent[:-1]
            else:
                silent.append(name[1])
        yield piece
