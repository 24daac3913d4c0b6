"""What is done to a film after it was filmed: parts left out, frames left out, a picture that stays, another film behind it, a file
cut short.

Frames are never encoded anew. Each function reads the video of one folder and writes that of another; seconds.
"""
import subprocess

from .picture import FPS

CUT_S = (5.0, 7.0)  # what a jump cut leaves out
STALL_S = (5.0, 7.0)  # where a camera that stalls gives the same picture
JOINED_S = 6.0  # where another film goes on
TRUNCATED_SHARE, HEAD_BYTES = 0.7, 1500
# Which frames a camera leaves out whose exposure grows longer and shorter: between none and four of ten.
DROPPED = r"gt(mod(n*0.618034\,1)\,0.8+0.2*cos(n/60))"


def jump_cut(video, out):
    """Two seconds are left out, and the times run on."""
    first, last = (round(t * FPS) for t in CUT_S)
    copy(video, out, rf"noise=drop='between(n\,{first}\,{last - 1})',setts=ts=N/{FPS}/TB")


def stalled(video, out):
    """One picture stays for two seconds, in which the times run on; then the film goes on with the next one."""
    begin_s, end_s = STALL_S
    picture = mjpeg("-ss", f"{begin_s}", "-i", video, "-frames:v", "1")
    join([mjpeg("-i", video, "-t", f"{begin_s}"), picture * round((end_s - begin_s) * FPS), mjpeg("-ss", f"{begin_s}", "-i", video)], out)


def shortened(video, out):
    """The film ends where a jump cut would leave something out."""
    ffmpeg("-i", video, "-t", f"{CUT_S[0]}", "-c", "copy", out)


def variable_rate(video, out):
    """Frames are left out, at times more of them than at others; the others keep their times."""
    copy(video, out, f"noise=drop='{DROPPED}'")


def half_rate(video, out):
    """Every second frame is left out, and the file says so."""
    join([mjpeg("-i", video, "-bsf:v", r"noise=drop='mod(n\,2)'")], out, FPS / 2)


def joined(video, other, out):
    """The film goes on as another one."""
    join([mjpeg("-i", video, "-t", f"{JOINED_S}"), mjpeg("-ss", f"{JOINED_S}", "-i", other)], out)


def truncated(video, out):
    """The file ends in the middle of a frame."""
    whole = video.read_bytes()
    out.write_bytes(whole[: round(TRUNCATED_SHARE * len(whole))])


def head_only(video, out):
    """The file ends before its first frame does."""
    out.write_bytes(video.read_bytes()[:HEAD_BYTES])


def copy(video, out, filters):
    ffmpeg("-i", video, "-c", "copy", "-bsf:v", filters, out)


def mjpeg(*arguments):
    """Pictures one after the other, without times."""
    return ffmpeg(*arguments, "-c", "copy", "-f", "mjpeg", "-")


def join(parts, out, rate_hz=FPS):
    """Pictures at even times."""
    ffmpeg("-f", "mjpeg", "-framerate", f"{rate_hz}", "-i", "-", "-c", "copy", out, given=b"".join(parts))


def ffmpeg(*arguments, given=None):
    """What it writes to its standard output."""
    done = subprocess.run(["ffmpeg", "-v", "error", "-y", *arguments], input=given, stdout=subprocess.PIPE, check=True)
    return done.stdout
