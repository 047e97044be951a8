"""`gesture-bot bank preview`: the picture and the film of a gesture, and names that are not there."""

import pytest
from PIL import Image

from gesture_bot.cli.main import main

BANK = """
gestures:
  salute:
    triggers: [aye]
    keyframes:
      - {time: -0.3, right: home}
      - {time: 0.0, hold: 0.3, right: {wrist: {forward: 0.3, out: -0.1, up: 0.35}, palm: down in}}
"""


def test_a_strip_shows_each_keyframe(tmp_path, capsys):
    widths = {}
    for name in ("me", "hello"):
        assert main(["bank", "preview", name, "-o", str(tmp_path / f"{name}.png")]) == 0
        with Image.open(tmp_path / f"{name}.png") as picture:
            assert len(picture.convert("L").getcolors()) > 20
            widths[name] = picture.width
    assert widths["hello"] > 3 * widths["me"]
    assert capsys.readouterr().out == f"wrote {tmp_path / 'me.png'}\nwrote {tmp_path / 'hello.png'}\n"


def test_a_film_runs_in_real_time(tmp_path):
    assert main(["bank", "preview", "stop", "-o", str(tmp_path / "stop.gif")]) == 0
    with Image.open(tmp_path / "stop.gif") as film:
        seconds = 0
        for frame in range(film.n_frames):
            film.seek(frame)
            seconds += film.info["duration"] / 1000
        assert seconds == pytest.approx(0.5 + 0.24 + 0.55 + 0.7, abs=0.2)


def test_a_gesture_of_ones_own(tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text(BANK)
    monkeypatch.chdir(tmp_path)
    assert main(["bank", "preview", "salute", "--bank", "mine.yaml"]) == 0
    assert (tmp_path / "salute.png").exists()


def test_what_is_not_there_is_named_with_what_is(tmp_path, capsys):
    (tmp_path / "mine.yaml").write_text(BANK)
    assert main(["bank", "preview", "juggle"]) == 1
    assert "unknown gesture: 'juggle'; valid: above, " in capsys.readouterr().err
    assert main(["bank", "preview", "hello", "--bank", str(tmp_path / "mine.yaml")]) == 1
    assert "unknown gesture: 'hello'; valid: salute" in capsys.readouterr().err
    assert main(["bank", "preview", "hello", "-o", "hello.svg"]) == 1
    assert "'.svg'; valid: .png, .gif" in capsys.readouterr().err
    assert main(["bank", "preview", "hello", "--bank", str(tmp_path / "none.yaml")]) == 1
    assert "none.yaml" in capsys.readouterr().err
