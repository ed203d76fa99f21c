"""Videos for the page: small, short, quiet, and playable."""

import html.parser
import re
import subprocess
import sys

import imageio_ffmpeg
import mediapy
import numpy as np
import pytest

from inbounds.book.drawing import videos
from inbounds.robots import Film


def film(seconds: float = 1.0, fps: float = 25.0, shape=(48, 64), noise: int = 0) -> Film:
    """A dark film whose first frame is bright, with optional noise that is hard to compress."""
    rng = np.random.default_rng(0)
    frames = np.full((round(seconds * fps), *shape, 3), 60, np.uint8)
    frames[0] = 200
    if noise:
        frames += rng.integers(0, noise, frames.shape, dtype=np.uint8)
    return Film(frames, fps, 0.0)


def read(mp4: bytes, tmp_path) -> tuple[str, np.ndarray]:
    """ffmpeg's description of an MP4's stream, and its frames [T, 48, 64, 3]."""
    path = tmp_path / "film.mp4"
    path.write_bytes(mp4)
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(command, capture_output=True, check=True)
    stream = next(line for line in done.stderr.decode().splitlines() if "Video:" in line)
    return stream, np.frombuffer(done.stdout, np.uint8).reshape(-1, 48, 64, 3)


def test_the_encoding_is_what_browsers_play(tmp_path):
    (video,) = videos.show_films({"One": film()})
    stream, frames = read(video.mp4, tmp_path)
    for property_ in ("h264", "yuv420p", "64x48", "25 fps"):
        assert property_ in stream
    assert len(frames) == 25
    assert frames[0].mean() == pytest.approx(200, abs=4)  # it starts with frame 0
    assert frames[1].mean() == pytest.approx(60, abs=4)
    # no frame is shown out of order, so that nothing has to be skipped at the start
    assert b"ctts" not in video.mp4
    # the index precedes the data, so that the duration is known early
    assert video.mp4.index(b"moov") < video.mp4.index(b"mdat")


def test_encoding_is_deterministic():
    first, again = (videos.show_films({"One": film(noise=9)})._repr_html_() for _ in range(2))
    assert first == again


def test_the_text_form_names_the_videos():
    assert repr(videos.show_films({"A": film()})) == "<1 video: 'A'>"
    assert repr(videos.show_films({"A": film(), "B": film()})) == "<2 videos: 'A', 'B'>"


class Tags(html.parser.HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: dict[str, list[dict]] = {}
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.setdefault(tag, []).append(dict(attrs))


def test_the_page_shows_it_quietly():
    text = videos.show_films({"Gaussian": film(), 'σ < 1 & "more"': film()})._repr_html_()
    tags = Tags(text).found
    assert len(tags["video"]) == len(tags["figure"]) == len(tags["figcaption"]) == 2
    for video in tags["video"]:
        assert {"controls", "muted", "playsinline"} <= video.keys()
        assert not {"autoplay", "loop"} & video.keys()
        assert video["preload"] == "metadata"
        assert video["poster"].startswith("data:image/jpeg;base64,")
        assert "width" not in video, "a fixed width would overflow a phone"
        assert "max-width" not in video["style"]
    assert tags["video"][1]["aria-label"].endswith('σ < 1 & "more"')
    assert "σ &lt; 1 &amp; &#34;more&#34;</figcaption>" in text
    assert "flex-wrap:wrap" in tags["div"][0]["style"]
    assert "color" not in text.split("base64")[0]  # theme-neutral
    assert not re.search(r"https?://", text)


def test_the_poster_of_a_film_by_itself_is_the_first_frame():
    (video,) = videos.show_films({"One": film()})
    assert mediapy.decompress_image(video.poster).mean() == pytest.approx(200, abs=4)


def test_posters_of_a_comparison_show_where_all_films_differ():
    """Frame 10: one of three differs a lot; frame 15: all differ, by less. The shortest film ends at 20."""
    films = [film(seconds=seconds) for seconds in (1.0, 0.8, 1.0)]
    films[2].frames[10] = 250
    for each, brightness in zip(films, (90, 120, 150), strict=True):
        each.frames[15] = brightness
    films[0].frames[22], films[2].frames[22] = 0, 255  # nothing to compare with any more
    assert videos.most_telling(films) == pytest.approx(15 / 25)
    row = videos.show_films(dict(zip("ABC", films, strict=True)))
    shown = [mediapy.decompress_image(video.poster).mean() for video in row]
    assert shown == pytest.approx([90, 120, 150], abs=4)


def test_moments_are_compared_in_seconds():
    """The same second is frame 5 of the one and frame 10 of the other."""
    slow, fast = film(fps=10.0), film(fps=20.0)
    slow.frames[5], fast.frames[5] = 255, 255
    slow.frames[7], fast.frames[14] = 255, 255
    slow.frames[0] = fast.frames[0] = 60
    assert videos.most_telling([slow, fast]) == pytest.approx(0.5)


def test_films_of_two_sizes_open_with_their_first_frames():
    films = {"One": film(), "Other": film(shape=(64, 64))}
    for video in videos.show_films(films):
        assert mediapy.decompress_image(video.poster).mean() == pytest.approx(200, abs=4)


def test_a_film_hard_to_compress_is_encoded_more_coarsely():
    hard = film(seconds=2.0, shape=(96, 128), noise=120)
    assert len(videos._encode(hard, 30)) > videos.MAX_BYTES
    (video,) = videos.show_films({"Noise": hard})
    assert len(video.mp4) <= videos.MAX_BYTES


def test_a_film_too_large_is_refused():
    with pytest.raises(ValueError, match=r"'Noise' takes \d+ kB, a page allows 120 kB: record fewer"):
        videos.show_films({"Noise": film(seconds=2.0, shape=(240, 320), noise=190)})


def test_a_film_too_long_is_refused():
    videos.show_films({"Five": film(seconds=5.0)})
    with pytest.raises(ValueError, match=r"lasts 5\.2 s, a page allows 5 s"):
        videos.show_films({"Long": film(seconds=5.2)})


def test_odd_sizes_and_empty_rows_are_refused():
    with pytest.raises(ValueError, match="must be even"):
        videos.show_films({"Odd": film(shape=(48, 63))})
    with pytest.raises(ValueError, match="no film"):
        videos.show_films({})


def test_files_may_be_longer_and_are_finer(tmp_path):
    long = film(seconds=6.0, noise=20)
    path = videos.write_film(tmp_path / "run.mp4", long)
    _, frames = read(path.read_bytes(), tmp_path)
    assert len(frames) == 150
    assert len(path.read_bytes()) > len(videos._encode(long, 30))


def test_missing_ffmpeg_names_the_fix(monkeypatch):
    def nothing() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", nothing)
    with pytest.raises(RuntimeError, match=r"pip install .*imageio-ffmpeg"):
        videos.show_films({"One": film()})


def test_missing_mediapy_names_the_fix(monkeypatch):
    monkeypatch.setitem(sys.modules, "mediapy", None)
    with pytest.raises(RuntimeError, match=r"mediapy: pip install '\.\[video\]'"):
        videos.show_films({"One": film()})
