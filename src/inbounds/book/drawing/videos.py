"""Short captioned videos, side by side, inside a page.

A video is an MP4 (H.264, 4:2:0, the one format that every browser plays), carried in the page itself, so that the
built book needs no other file. It starts when the reader asks, ends after at most five seconds and weighs at
most 120 kB. The encoder is the ffmpeg that the package `imageio-ffmpeg` brings along.

The browser's own controls stand in a band below the picture, not on it: they need no script, and a keyboard reaches
them. Films that are shown together open with the moment in which they differ most.
"""

from __future__ import annotations

import base64
import itertools
import os
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from inbounds.book.templates import macros
from inbounds.learning.storage.whole_files import write_whole

if TYPE_CHECKING:  # what encodes a film needs no MuJoCo
    from inbounds.robots.rendering import Film

MAX_SECONDS = 5.0
MAX_BYTES = 120_000

_PAGE_QUANTISERS = (30, 33, 36, 39, 42)  # the first that keeps a video small enough is taken
_FILE_QUANTISER = 22  # for files, which are watched larger
# No frame is predicted from a later one, so the stream opens with frame 0 and no player has to skip;
# the index stands at the front, so that the duration is known before the video is played.
_FFMPEG_ARGS = ("-bf", "0", "-movflags", "+faststart", "-map_metadata", "-1", "-fflags", "+bitexact")

_BAND = 60  # pixels below the picture: Chromium's controls take 56, Firefox's 40


@dataclass(frozen=True)
class Video:
    """One encoded video.

    Attributes:
        title: the caption.
        mp4: the file's bytes.
        poster: JPEG of one frame, shown until the video is played.
        width: in pixels.
        height: in pixels.
        seconds: duration.

    Part of what `show_films` returns, which has an example.
    """

    title: str
    mp4: bytes
    poster: bytes
    width: int
    height: int
    seconds: float

    def to_html(self) -> str:
        """Return a figure with the video and its caption."""
        pictures = _base64(self.poster), _base64(self.mp4)
        size = self.width, self.height, _BAND
        return str(macros("videos").video(self.title, self.seconds, *size, *pictures))


class VideoRow:
    """Videos side by side; on a narrow screen, one below the other. A notebook shows the object itself.

    Attributes:
        videos: the encoded videos, in order.
        loop: whether they play by themselves, over and over, where the reader has not asked for less motion.

    Made by `show_films`, which has an example.
    """

    def __init__(self, videos: list[Video], *, loop: bool = False) -> None:
        self.videos = videos
        self.loop = loop

    def __iter__(self) -> Iterator[Video]:
        return iter(self.videos)

    def __repr__(self) -> str:
        count = f"{len(self.videos)} video{'s' if len(self.videos) != 1 else ''}"
        return f"<{count}: {', '.join(repr(video.title) for video in self.videos)}>"

    def _repr_html_(self) -> str:
        return str(macros("videos").row([video.to_html() for video in self.videos], self.loop))


def show_films(films: Mapping[str, Film], *, loop: bool = False) -> VideoRow:
    """Encode films for a page, side by side under their captions.

    Before they are played, all show the same moment: the one in which the two films that are most alike differ most.
    A film by itself shows its first frame.

    Args:
        films: caption → film, each of at most five seconds and of even width and height.
        loop: in the book, let them play by themselves, on one clock, over and over (`book.js` does it).

    Returns:
        An object that a notebook shows as videos, and whose text form names them.

    Raises:
        ValueError: no film; a film too long, or too large even when coarsely encoded; odd size.
        RuntimeError: no ffmpeg, or mediapy is missing; the message names the fix.

    Example:
        >>> import numpy as np
        >>> from inbounds.robots import Film
        >>> frames = np.zeros((10, 32, 48, 3), np.uint8)
        >>> show_films({"Gaussian": Film(frames, 25.0, 0.0), "Beta": Film(frames, 25.0, 0.0)})
        <2 videos: 'Gaussian', 'Beta'>
    """
    if not films:
        raise ValueError("there is no film to show: pass a mapping from captions to films")
    moment = most_telling(list(films.values()))
    return VideoRow([_encode_for_page(title, film, moment) for title, film in films.items()], loop=loop)


def most_telling(films: Sequence[Film]) -> float:
    """Return the moment, in seconds, in which the two films that are most alike differ most.

    Args:
        films: that are to be compared; where there is one, or their sizes differ, the moment is the first frame's.

    Example:
        >>> from inbounds.robots import Film
        >>> frames = np.zeros((2, 10, 32, 32, 3), np.uint8)
        >>> frames[1, 4] = 255
        >>> most_telling([Film(each, fps=20, total_reward=0.0) for each in frames])
        0.2
    """
    if len(films) < 2 or len({film.frames.shape[1:] for film in films}) > 1:
        return 0.0
    seconds = min(len(film.frames) / film.fps for film in films)
    fps = min(film.fps for film in films)
    moments = np.arange(int(seconds * fps)) / fps

    def apart(moment: float) -> float:
        # Every fourth pixel will do, and saves most of the time.
        seen = [film.frames[round(moment * film.fps), ::4, ::4].astype(np.int16) for film in films]
        return float(min(np.abs(a - b).mean() for a, b in itertools.combinations(seen, 2)))

    return float(max(moments, key=apart))


def write_film(path: str | os.PathLike[str], film: Film) -> Path:
    """Write a film to an MP4 file, of any length and in good quality.

    Args:
        path: of the file; its folder must exist.
        film: the film, of even width and height.

    Returns:
        The path.

    Raises:
        ValueError: odd width or height.
        RuntimeError: no ffmpeg, or mediapy is missing; the message names the fix.
        OSError: it could not be written, as on a full disk; nothing is left of it.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import numpy as np
        >>> from inbounds.robots import Film
        >>> black = Film(np.zeros((4, 32, 32, 3), np.uint8), fps=20, total_reward=0.0)
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     write_film(Path(folder) / "black.mp4", black).stat().st_size > 0
        True
    """
    path = Path(path)
    write_whole(path, _encode(film, _FILE_QUANTISER))
    return path


def _encode_for_page(title: str, film: Film, moment: float) -> Video:
    num_frames, height, width = film.frames.shape[:3]
    seconds = num_frames / film.fps
    if seconds > MAX_SECONDS:
        raise ValueError(
            f"{title!r} lasts {seconds:.1f} s, a page allows {MAX_SECONDS:.0f} s: record fewer seconds"
        )
    for quantiser in _PAGE_QUANTISERS:
        mp4 = _encode(film, quantiser)
        if len(mp4) <= MAX_BYTES:
            poster = _poster(film.frames[round(moment * film.fps)])
            return Video(title, mp4, poster, width, height, seconds)
    raise ValueError(
        f"{title!r} takes {len(mp4) / 1000:.0f} kB, a page allows {MAX_BYTES / 1000:.0f} kB: "
        "record fewer seconds or smaller frames"
    )


def _encode(film: Film, quantiser: int) -> bytes:
    """Return the film as the bytes of an MP4 file; a larger quantiser (0 to 51) makes it smaller and coarser."""
    height, width = film.frames.shape[1:3]
    if height % 2 or width % 2:
        raise ValueError(f"width and height must be even for 4:2:0 colour, got {width} × {height}")
    data: bytes = _mediapy().compress_video(
        film.frames,
        codec="h264",
        fps=film.fps,
        qp=quantiser,
        encoded_format="yuv420p",
        ffmpeg_args=_FFMPEG_ARGS,
    )
    return data


def _poster(frame: NDArray[np.uint8]) -> bytes:
    data: bytes = _mediapy().compress_image(frame, fmt="jpeg", quality=60)
    return data


def stills(film: bytes, count: int = 3) -> list[bytes]:
    """Return frames of a film as JPEG pictures, from its first to its last at equal distances: a film on paper.

    Args:
        film: an MP4 file's content.
        count: of frames, at least two.

    Raises:
        RuntimeError: mediapy or ffmpeg is missing; the message names the fix.

    Example:
        >>> frames = [np.full((32, 32, 3), value, np.uint8) for value in (0, 128, 255)]
        >>> len(stills(_mediapy().compress_video(frames, fps=10), 2))
        2
    """
    _mediapy()
    import imageio_ffmpeg

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "film.mp4")
        file.write_bytes(film)
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-loglevel", "error", "-i", str(file), "-q:v", "4"]
        subprocess.run([*command, str(Path(folder, "%05d.jpg"))], check=True, stdin=subprocess.DEVNULL)
        frames = sorted(Path(folder).glob("*.jpg"))
        chosen = np.linspace(0, len(frames) - 1, count).round().astype(int)
        return [frames[i].read_bytes() for i in chosen]


def require_encoder() -> None:
    """Raise unless films can be encoded.

    Raises:
        RuntimeError: mediapy or ffmpeg is missing; the message names the fix.

    Example:
        >>> require_encoder()
    """
    _mediapy()


def _mediapy() -> Any:
    """Return the library mediapy, told to use the ffmpeg that imageio-ffmpeg brings."""
    try:
        import imageio_ffmpeg
        import mediapy
    except ImportError as error:
        raise RuntimeError(f"videos need {error.name}: pip install '.[video]' in the source tree") from error
    try:
        mediapy.set_ffmpeg(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise RuntimeError(
            "no ffmpeg was found to encode videos: pip install --force-reinstall imageio-ffmpeg "
            "(its wheel brings one), or set IMAGEIO_FFMPEG_EXE to the path of yours"
        ) from error
    return mediapy


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")
