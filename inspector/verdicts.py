"""Verdicts in words, for the terminal and the viewer, and one verdict on several frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import replace

from calibnet.geometry import degrees_and_cm
from calibnet.geometry.median import median_pose
from calibnet.geometry.types import Extrinsic
from calibnet.runtime.text import listed
from calibnet.verdict import ACCEPTED, CANNOT_TELL, REJECTED, WORDS, BadFrame, Cause, Verdict, Word, moved

OF_GIVEN = "Calibration as given"
"""Heading of the verdict on the calibration that `verify` judges."""
OF_RESULT = "Calibration found"
"""Heading of the verdict on the result that it is compared with."""


def verdict_line(verdict: Verdict) -> str:
    """The last line of a run."""
    return f"Verdict: {verdict.word}. {with_advice(verdict)}"


def with_advice(verdict: Verdict) -> str:
    """The reason, the likely causes, and what to do next."""
    return " ".join(filter(None, (explained(verdict), verdict.advice)))


def explained(verdict: Verdict) -> str:
    """The reason, and the likely causes in the input."""
    return " ".join([verdict.reason, *further_causes(verdict)])


def further_causes(verdict: Verdict) -> list[str]:
    """Sentences on the causes that the reason does not contain already."""
    texts = dict.fromkeys(cause.text for cause in verdict.causes)  # two names may have the same sentence
    return [text for text in texts if not _is_told(text, verdict.reason)]


def _is_told(text: str, reason: str) -> bool:
    """Whether a reason contains a cause's sentence already, perhaps as the end of one of its own."""
    return text.rstrip(".").casefold() in reason.casefold()


def title(verdict: Verdict, of: str = "") -> str:
    """The word, and the tolerance that the extrinsic is within, where one is certain.

    Args:
        verdict: the verdict.
        of: what it is a verdict on, where that is not the result of the run.
    """
    if of:
        return f"{of}: {title(verdict).lower()}"
    word = verdict.word.capitalize()
    return word if verdict.within is None else f"{word} · within {verdict.within}"


def certainty(verdict: Verdict) -> str:
    """Uncertainty of the result in degrees and centimetres; empty where there is none, or the reason has one."""
    if verdict.covariance is None or "±" in verdict.reason or "1σ" in verdict.reason:
        return ""
    return f"±{degrees_and_cm(verdict.sigma_rotation_deg, verdict.sigma_translation_cm)} (1σ)."


def markdown_lines(verdict: Verdict, of: str = "") -> list[str]:
    """The verdict as a heading, the reason, the causes with their evidence, what to do next, and the uncertainty.

    Args:
        verdict: the verdict.
        of: what it is a verdict on, where that is not the result of the run.
    """
    lines = [f"# {title(verdict, of)}", "", verdict.reason, ""]
    lines += [f"- **{cause.name}**: {once(cause, verdict)}*({cause.evidence})*" for cause in verdict.causes]
    lines += [""] if verdict.causes else []
    lines += [verdict.advice, ""] if verdict.advice else []
    return [*lines, certainty(verdict), ""] if certainty(verdict) else lines


def found_lines(found: Verdict, given: Verdict | None) -> list[str]:
    """The verdict on the result, to stand below that on the verified calibration, if any, without its reason again."""
    if given is None:
        return markdown_lines(found)
    if (found.reason, found.causes) == (given.reason, given.causes):
        found = replace(found, reason="For the same reason.", causes=(), advice="")
    return markdown_lines(found, OF_RESULT)


def once(cause: Cause, verdict: Verdict) -> str:
    """A cause's sentence and a space, unless the reason contains it already."""
    return "" if _is_told(cause.text, verdict.reason) else f"{cause.text} "


def verdict_counts(verdicts: Mapping[int, Verdict]) -> str:
    """The number of frames with each verdict, with numbers of those not accepted and the first one's reason."""
    parts = []
    for word in WORDS:
        frames = [frame for frame, verdict in verdicts.items() if verdict.word == word]
        parts.append(f"{len(frames)} {word}")
        if frames and word != ACCEPTED:
            others = f"frames {listed(frames)}; " if len(frames) > 1 else ""
            reason = explained(verdicts[frames[0]]).removesuffix(".")
            parts[-1] += f" ({others}frame {frames[0]}: {reason})"
    return f"Verdict: {', '.join(parts)}."


def of_frames(verdicts: Mapping[int, Verdict], initial: Extrinsic, skipped: Iterable[BadFrame] = ()) -> Verdict:
    """One verdict on several frames.

    It is rejected if half of them or more are, accepted if more than half are, and else cannot be told. A single
    frame's is its own.

    Args:
        verdicts: verdicts by frame number, at least one.
        initial: initial ``camera_from_lidar`` of the first frame, 4x4.
        skipped: frames that could not be used.

    Returns:
        The verdict on the median of the frames that are not rejected, or of all if all are. It has no covariance, since
        only a drive's estimate accounts for errors that frames share.
    """
    single, *others = verdicts.values()
    if not others:
        return replace(single, skipped=tuple(skipped))
    believed = [one for one in verdicts.values() if one.word != REJECTED] or list(verdicts.values())
    median = median_pose([one.camera_from_lidar for one in believed])
    reason = verdict_counts(verdicts).removeprefix("Verdict: ")
    return Verdict(
        majority(verdicts.values()),
        f"Of {len(verdicts)} frames {reason}",
        median,
        moved(initial, median),
        causes_of(verdicts.values()),
        used=len(verdicts),
        skipped=tuple(skipped),
    )


def majority(verdicts: Iterable[Verdict]) -> Word:
    """Rejected if half or more are, accepted if more than half are, else cannot tell."""
    counts = Counter(verdict.word for verdict in verdicts)
    total = counts.total()
    if 2 * counts[REJECTED] >= total:
        return REJECTED
    return ACCEPTED if 2 * counts[ACCEPTED] > total else CANNOT_TELL


def causes_of(verdicts: Iterable[Verdict]) -> tuple[Cause, ...]:
    """One cause of each name, the most frequent first."""
    found: dict[str, list[Cause]] = {}
    for verdict in verdicts:
        for cause in verdict.causes:
            found.setdefault(cause.name, []).append(cause)
    return tuple(same[0] for same in sorted(found.values(), key=len, reverse=True))
