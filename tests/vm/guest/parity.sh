# The clip through v4l2loopback, filmed, recorded and then replayed from that recording. Once in each format.
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
modprobe v4l2loopback devices=1 video_nr=0 card_label=replay exclusive_caps=1
# The recording's outline at half its size, every other corner.
printf '{"frame":0,"width":320,"height":180,"polygon_px":%s}' '[[126,0],[120,10],[126,52],[122,74],[107,68],[102,58],[93,71],[109,101],
[105,115],[136,122],[149,130],[153,165],[170,168],[172,149],[198,116],[233,91],[230,69],[238,51],[222,44],[224,26],
[207,10],[197,31],[177,58],[158,64],[151,34],[142,16],[135,0]]' >"$work/outline.json"

fed() { v4l2-ctl -d /dev/video0 -D | grep -q "Video Capture"; }

# film_live RATE_HZ FRAMES: plays the clip in a format and films so many frames of it. The filming ends by itself: who asks for the end waits
# five seconds for the sway, in which an emulated processor has looked at some of it, and the replay looks at all of it.
film_live() {
    cp "/vm/clip-$format-$1.mcap" "$work/"
    "$bin" play "$work/clip-$format-$1.mcap" --to /dev/video0 --loop 2>"/vm/play-$format" &
    player=$!
    until_ok 10 fed
    # The wood takes an emulated processor a minute to find. tests/commands/recording.rs has it, and refinements.
    printf '[camera]\nformat = "%s"\nwidth = 320\nheight = 180\nrate_hz = %s\n[detect]\npoints = 120\n[accumulate]\nrefine_s = 0.0\n[skeleton]\nalong_wood = false\n' \
        "$format" "$1" >"$work/camera.toml"
    rm -rf "/vm/live-$format" "$work/live-$format.mcap"
    begin "live-$format" capture /dev/video0 --headless --config "$work/camera.toml" \
        --outline "$work/outline.json" --record "$work/live-$format.mcap" --out "$work/live-$format" --for $(($2 / $1))
    end $(($2 / $1 + 90))
    kill -INT $player
    wait $player || true
    rm "$work/clip-$format-$1.mcap"
}
had_time_for_every_frame() { grep -q '"frames_dropped_tracker": 0' "/vm/live-$format/capture/capture.json"; }

# Some frames tell whether there would be time for all.
format=mjpeg
for fastest_hz in 8 4 2; do
    ((fastest_hz > 2)) || break
    film_live $fastest_hz 48
    ! had_time_for_every_frame || break
done
for format in mjpeg yuyv; do
    # Only a capture that had time for every frame can equal its replay; a machine that is busy otherwise gets a slower
    # film, and so does the next format there.
    for rate_hz in 8 4 2; do
        ((rate_hz <= fastest_hz)) || continue
        film_live $rate_hz 160
        ! had_time_for_every_frame || break
    done
    fastest_hz=$rate_hz
    cp "$work/live-$format.mcap" /vm/
    begin "replay-$format" replay "$work/live-$format.mcap" --headless --fast --config "$work/camera.toml" \
        --outline "$work/outline.json" --out "$work/replay-$format"
    end 90
done
