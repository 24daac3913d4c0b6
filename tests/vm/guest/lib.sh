# What the guest scripts have in common. Arguments of each: the program under test, and this test's own binary, which
# plays the USB camera.
bin=$1 helper=$2 here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
clip=/vm/clip.mjpg
work=/tmp/arborcam-vm
rm -rf "$work"
mkdir -p "$work"

now() { cut -d' ' -f1 /proc/uptime; }

# until SECONDS COMMAND...: waits until it succeeds.
until_ok() {
    local left=$(($1 * 20))
    shift
    until "$@" >/dev/null 2>&1; do
        ((left-- > 0)) || { echo "waited in vain: $*" >&2; return 1; }
        sleep 0.05
    done
}

# What every thread of the case begun last does, and every thread of the system that the kernel does not let be woken:
# state, where it waits, the call it is in, and the kernel's stack. Goes to /vm/stacks, for whoever looks for a fault.
stacks() {
    local task
    {
        echo "== $name at $(now) s: $*"
        for task in "/proc/$pid"/task/* /proc/[0-9]*; do
            [[ $task == */task/* ]] || grep -qs '^State:.D' "$task/status" || continue
            echo "-- $(cat "$task/comm") ${task##*/}: $(grep ^State: "$task/status")," \
                "in $(cat "$task/wchan"), call $(cut -d' ' -f1 "$task/syscall")"
            cat "$task/stack"
        done
        echo "-- open: $(readlink "/proc/$pid"/fd/* | grep /dev/video | tr '\n' ' ')"
        echo "-- the kernel's last words"
        dmesg | tail -n 30
    } >>/vm/stacks 2>/dev/null
}

# Runs the program in the background as case NAME: its output, and afterwards its status, go to /vm/NAME/.
begin() {
    name=$1
    shift
    mkdir -p "/vm/$name"
    now >"/vm/$name/begun"
    "$bin" "$@" >"/vm/$name/stdout" 2>"/vm/$name/stderr" </dev/null &
    pid=$!
}

# Waits SECONDS at least for the case begun last, longer where the guest is busy; what does not end then is killed and has
# status `hung`.
end() {
    local left=$(($1 * 20)) status=0
    while kill -0 "$pid" 2>/dev/null; do
        if ((left-- <= 0)); then
            echo hung >"/vm/$name/status"
            stacks "does not end"
            kill -KILL "$pid"
            # One that hangs in the kernel cannot be killed; the other cases need not wait for it.
            until_ok 5 eval "! kill -0 $pid" || stacks "cannot be killed"
            return
        fi
        sleep 0.05
    done
    wait "$pid" || status=$?
    now >"/vm/$name/ended"
    echo "$status" >"/vm/$name/status"
    [[ ! -d $work/$name ]] || cp -r "$work/$name" "/vm/$name/capture"
    rm -rf "${work:?}/${name:?}"
}

# Asks the case begun last to stop, as from the keyboard, and waits for its end.
stop() {
    now >"/vm/$name/asked"
    kill -INT "$pid" 2>/dev/null
    end 40
}

running() { kill -0 "$pid" 2>/dev/null; }

# A USB camera with the serial number $1, in port $2 (0), that delivers the clip at 15 Hz while $gate is there.
gate=$work/gate
plug_in() {
    "$helper" usb-camera "$work/clip.mjpg" 320 180 15 "$1" "${2:-0}" "$gate" &
    camera=$!
}
# A depth camera in port 1, that delivers /vm/depth.z16 at 30 Hz while $gate is there; its device is $depth.
plug_in_depth() {
    "$helper" usb-camera /vm/depth.z16 320 180 30 depth 1 "$gate" &
    depth_camera=$!
    until_ok 10 compgen -G '/sys/bus/usb/devices/1-2:1.0/video4linux/video*'
    depth=/dev/$(cd /sys/bus/usb/devices/1-2:1.0/video4linux && ls | head -1)
    until_ok 10 test -e "$depth"
}
pull_out_depth() {
    kill "$depth_camera"
    wait "$depth_camera" 2>/dev/null || true
}
pull_out() {
    kill "$camera"
    wait "$camera" 2>/dev/null || true
}

# What the captures of that camera are asked for with.
usb_camera_settings() {
    modprobe vhci-hcd
    modprobe uvcvideo
    cp $clip "$work/clip.mjpg"
    touch "$gate"
    # Fewer points than usual: an emulated processor is slow.
    printf '[camera]\nformat = "mjpeg"\nwidth = 320\nheight = 180\nrate_hz = 15\n[detect]\npoints = 120\n' \
        >"$work/camera.toml"
    printf '{"frame":0,"width":320,"height":180,"polygon_px":[[8,8],[311,8],[311,171],[8,171]]}' >"$work/outline.json"
    usb_settings=(--config "$work/camera.toml" --outline "$work/outline.json")
}

# Until the program has mapped its buffers, which is when it starts to film.
filming() { grep -q '/dev/video' "/proc/$1/maps"; }
