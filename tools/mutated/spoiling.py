"""Files spoilt at random, by seeds: what people mistype, cut off or mix up."""

from __future__ import annotations

import random
import re

#: What stands in place of a number or a name.
ODD = (
    "0", "-1", "1", "3.", "1e308", "-1e308", "1e200", "1e-320", "nan", "inf", "99999999999999999999",
    "2147483648", "1e999", "", "x", "-0.0", "1,2", "''", '"', "*", "**", "ALL", "1e5e5", "\u00e4", "\x00",
    "0x1F", "--1", "1 2",
)  # fmt: skip
_TOKEN = re.compile(r"[^\s,=\[\]{}()\"]+")


def _lines(text: str, dice: random.Random) -> str:
    """Leave a line out, repeat it, move it, or exchange two."""
    lines = text.splitlines(keepends=True) or [""]
    first, second = dice.randrange(len(lines)), dice.randrange(len(lines))
    kind = dice.randrange(4)
    if kind == 0:
        del lines[first]
    elif kind == 1:
        lines.insert(second, lines[first])
    elif kind == 2:
        lines.insert(second, lines.pop(first))
    else:
        lines[first], lines[second] = lines[second], lines[first]
    return "".join(lines)


def _token(text: str, dice: random.Random) -> str:
    """Put something odd, or another word of the file, in place of a word."""
    found = list(_TOKEN.finditer(text))
    if not found:
        return text
    old = dice.choice(found)
    new = dice.choice(ODD) if dice.random() < 0.7 else dice.choice(found).group()
    return text[: old.start()] + new + text[old.end() :]


def _letter(text: str, dice: random.Random) -> str:
    """Leave a letter out, or put one in."""
    place = dice.randrange(len(text) + 1)
    if dice.random() < 0.5:
        return text[:place] + text[place + 1 :]
    return text[:place] + dice.choice(",*=.-+0123456789aEX \n[]{}\"'#") + text[place:]


def _cut(text: str, dice: random.Random) -> str:
    """Take the beginning alone, or leave a part of the middle out."""
    first, second = sorted(dice.randrange(len(text) + 1) for _ in range(2))
    return text[:second] if dice.random() < 0.5 else text[:first] + text[second:]


def spoilt_text(text: str, dice: random.Random) -> str:
    """Return a text with one to three mistakes."""
    for _ in range(dice.choice((1, 1, 1, 2, 3))):
        text = dice.choice((_lines, _token, _token, _token, _letter, _cut))(text, dice)
    return text


def spoilt_bytes(data: bytes, dice: random.Random) -> bytes:
    """Return bytes of which some are others, or are missing."""
    found = bytearray(data)
    for _ in range(dice.choice((1, 2, 5))):
        place = dice.randrange(max(len(found), 1))
        if dice.random() < 0.2:
            del found[place : place + dice.randrange(1, 200)]
        elif place < len(found):
            found[place] = dice.randrange(256)
    return bytes(found)
