# A USB camera that is pulled out and plugged in again, twenty times, under one capture. The folder `cycles` gets a line
# for each: when it was pulled, when the kernel had it back, and when frames flowed again.
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
cycles=20
usb_camera_settings

devices() { cat /sys/class/video4linux/video*/dev 2>/dev/null | sort | tr '\n' ' '; }
frames() { wc -l <"/vm/$name/stdout"; }
more_frames() { (($(frames) > $1)); }
plugged() { compgen -G '/sys/bus/usb/devices/1-1:1.0/video4linux/video*'; }

plug_in one
until_ok 10 test -e /dev/video0
begin replug capture /dev/video0 --headless --stream ndjson "${usb_settings[@]}" --out "$work/replug" --retry-delay 0.2
# Poses are counted: they come once the tree is built.
until_ok 40 more_frames 20
for ((n = 0; n < cycles; n++)); do
    running || break
    pulled=$(now)
    pull_out
    # Long enough for the kernel to take the device away, and sometimes for the next attempt to fail.
    sleep "0.$((3 + n % 5))"
    # Another camera is not the one that is waited for.
    if ((n == 10)); then
        plug_in another 1
        sleep 1.5
        before=$(frames)
        sleep 0.5
        echo "$before $(frames)" >/vm/another
        pull_out
        sleep 0.3
    fi
    before=$(frames)
    plug_in one
    until_ok 5 plugged || stacks "the kernel does not have the camera back"
    back=$(now)
    until_ok 10 more_frames "$before" || stacks "no frame after return $n"
    echo "$pulled $back $(now) $before $(frames) $(devices)" >>/vm/cycles
    sleep 0.4
done
stop
# Silent, not gone.
begin hang capture "$(ls /dev/video* | head -1)" --headless "${usb_settings[@]}" --out "$work/hang" --device-timeout 1
until_ok 5 filming "$pid"
sleep 2
rm "$gate"
sleep 2.5
touch "$gate"
sleep 3
stop
begin hang-once capture "$(ls /dev/video* | head -1)" --headless "${usb_settings[@]}" --out "$work/hang-once" \
    --device-timeout 1 --once
until_ok 5 filming "$pid"
sleep 2
rm "$gate"
end 15
"$bin" devices --json >/vm/devices.json 2>/vm/devices.err
# Not even what is asked of it when it is closed is answered: the capture is written all the same, and only the process
# itself waits for the kernel, which waits for the camera.
touch "$gate"
begin deaf capture "$(ls /dev/video* | head -1)" --headless "${usb_settings[@]}" --out "$work/deaf" --device-timeout 1
until_ok 5 filming "$pid"
sleep 3
touch "$gate.deaf"
sleep 6
now >/vm/deaf/asked
kill -INT "$pid"
until_ok 40 test -e "$work/deaf/capture.json" || stacks "the capture is not written"
now >/vm/deaf/written
pull_out
end 20
# A depth camera beside a camera, pulled out and plugged in again under the capture.
rm "$gate.deaf"
plug_in one
plug_in_depth
until_ok 10 compgen -G '/sys/bus/usb/devices/1-1:1.0/video4linux/video*'
colour=/dev/$(cd /sys/bus/usb/devices/1-1:1.0/video4linux && ls | head -1)
until_ok 10 test -e "$colour"
"$bin" devices --json >/vm/devices-depth.json 2>/vm/devices-depth.err
begin depth capture "$colour" --depth "$depth" --depth-unit 0.001 --depth-camera /vm/depth-camera.json --headless \
    "${usb_settings[@]}" --out "$work/depth" --record /vm/depth.mcap
until_ok 10 filming "$pid"
sleep 5
pull_out_depth
sleep 3
plug_in_depth
sleep 5
stop
pull_out_depth
pull_out
