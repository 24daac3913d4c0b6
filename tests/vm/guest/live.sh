# A capture in a real terminal: tmux gives it one, presses its keys and reads its screen.
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
usb_camera_settings
plug_in live
until_ok 10 test -e /dev/video0

mux() { tmux -S "$work/tmux" -f /dev/null "$@"; }
press() { mux send-keys -t live "$1"; }
screen() { mux capture-pane -p -t live >"/vm/$1.screen"; }
shows() { mux capture-pane -p -t live | grep -qE "$1"; }

mkdir -p /vm/live
# The shell stays, and shows what the program leaves behind on the terminal.
mux new-session -d -s live -x 120 -y 40 "env -i PATH=$PATH HOME=/tmp LANG=C.UTF-8 TERM=screen-256color PS1='after> ' \
    bash --norc --noprofile"
until_ok 10 shows 'after>'
press "$bin capture /dev/video0 ${usb_settings[*]} --out $work/live; \
echo \$? >/vm/live/status"
press Enter
until_ok 10 shows 'Camera'
sleep 3
screen watching
press '?'
sleep 0.5
screen help
press '?'
until_ok 60 shows 'Branches, [0-9]' || true
sleep 2
screen built
press e
# A later message may take its place.
until_ok 20 shows 'capture written to' || true
screen exported
now >/vm/live/asked
press q
until_ok 40 test -s /vm/live/status || true
now >/vm/live/ended
sleep 0.5
screen after
mux send-keys -t live "stty -a | tr ' ' '\n' | grep -xE 'echo;?|icanon;?' | tr '\n' ' ' >/vm/live/terminal" Enter
until_ok 5 test -s /vm/live/terminal || true
cp -r "$work/live" /vm/live/capture
cp -r "$work/live-1" /vm/live/exported

begin stream capture /dev/video0 --headless --stream ndjson "${usb_settings[@]}"
# As many as are asked for, and some more: what is cut by the end is none.
poses() { (($(grep -c '"nodes"' /vm/stream/stdout) > 12)); }
until_ok 60 poses || true
stop
mux kill-server
pull_out
