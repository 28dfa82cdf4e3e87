"""The picture of the architecture shows the house as it is."""

from __future__ import annotations

import runpy
import xml.etree.ElementTree as ET
from pathlib import Path

import matplotlib
from PIL import ImageFont

from tests.docs.pages import DOCS, ROOT
from tests.house.floors import FLOORS
from tests.house.source import modules

SVG = "{http://www.w3.org/2000/svg}"
PICTURE = DOCS / "pictures" / "architecture.svg"


def rooms_in_picture() -> dict[str, float]:
    """Return every room of the picture with its distance from the upper edge."""
    groups = ET.parse(PICTURE).getroot().iter(f"{SVG}g")
    return {group.attrib["data-room"]: float(group.attrib["data-y"]) for group in groups}


def test_every_room_is_in_the_picture() -> None:
    rooms = {module.room for module in modules()} - {"", "__main__"}
    assert len(rooms) > 15, "no rooms were found: nothing was tested"
    assert rooms - set(rooms_in_picture()) == set(), "add it to scripts/draw_architecture.py and run that"


def test_higher_floors_are_drawn_above() -> None:
    places = rooms_in_picture()
    heights = [{places[room] for room in floor} for floor in FLOORS[:-1]]
    assert all(len(height) == 1 for height in heights), "rooms of one floor stand side by side"
    downwards = [height.pop() for height in heights]
    assert downwards == sorted(downwards, reverse=True)
    assert len(set(downwards)) == len(FLOORS) - 1


def test_words_fit_into_their_rooms() -> None:
    font = ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf", 100)
    wide = []
    for group in ET.parse(PICTURE).getroot().iter(f"{SVG}g"):
        box, words = group.find(f"{SVG}rect"), group.findall(f"{SVG}text")
        if "data-room" not in group.attrib or box is None:
            continue
        end = float(box.attrib["x"]) + float(box.attrib["width"])
        for line in (each for each in words if each.get("text-anchor") != "middle"):
            length = font.getlength(line.text or "") * float(line.attrib["font-size"]) / 100
            wide += [line.text] if float(line.attrib["x"]) + length > end else []
    assert wide == []


def test_the_picture_is_that_of_its_script() -> None:
    script = runpy.run_path(str(ROOT / "scripts" / "draw_architecture.py"))
    assert script["picture"]() == PICTURE.read_text(encoding="utf-8"), "run scripts/draw_architecture.py"
