# The service under systemd, installed as `make install` does it. /vm/installed is what that wrote.
. "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
unit=arborcam@video0.service
cp -r /vm/installed/. /
systemd-sysusers
systemd-tmpfiles --create arborcam.conf
usb_camera_settings
cp "$work"/{camera.toml,outline.json} /etc/arborcam/
# Shorter limits than a camera in the field needs; all else is the unit as installed.
mkdir -p "/etc/systemd/system/$unit.d"
printf '[Service]\nWatchdogSec=6\n' >"/etc/systemd/system/$unit.d/test.conf"
printf '%s\n' ARBORCAM_LENGTH_S=3600 ARBORCAM_KEEP_FREE_MB=1 \
    'ARBORCAM_ARGS="--config /etc/arborcam/camera.toml --outline /etc/arborcam/outline.json"' >/etc/arborcam/arborcam.conf
udevadm control --reload
systemctl daemon-reload
systemctl enable "$unit" 2>/dev/null

property() { systemctl show "$unit" -p "$1" --value; }
state() { echo "$(property ActiveState)/$(property SubState)"; }
is() { [[ $(property ActiveState) == "$1" ]]; }
is_another() { [[ $(property MainPID) != "$1" && $(property MainPID) != 0 ]] && is active; }
films() {
    local main
    main=$(property MainPID)
    [[ $main != 0 ]] && filming "$main"
}
note() { echo "$2" >"/vm/$1"; }

note before "$(state)"
# It answers, and films nothing yet.
rm "$gate"
plug_in service
until_ok 15 films
sleep 1.5
note filming "$(state)"
touch "$gate"
now >/vm/flows
until_ok 10 is active
now >/vm/ready
note flowing "$(state)"
note user "$(property User) $(stat -c %U "/proc/$(property MainPID)")"
sleep 3

# Hung: only the watchdog can tell.
main=$(property MainPID)
cut=$(ls -d /var/lib/arborcam/video0/*.unfinished | tail -n 1)
now >/vm/stopped
kill -STOP "$main"
until_ok 20 test ! -e "/proc/$main"
# What it has filmed would be completed beside the next film, and an emulated processor is slow enough without that.
rm -r "$cut"
until_ok 40 is_another "$main"
now >/vm/restarted
note restarts "$(property NRestarts)"
sleep 4

main=$(property MainPID)
now >/vm/asked
kill -TERM "$main"
until_ok 40 test ! -e "/proc/$main"
now >/vm/ended
systemctl stop "$unit"
note stopping "$(property Result) $(property ExecMainStatus)"
ls -t /var/lib/arborcam/video0 >/vm/folders
# By name: an older one may have been completed since.
newest=$(ls -d /var/lib/arborcam/video0/*Z | tail -n 1)
cp -r "$newest" /vm/capture

systemctl start "$unit" --no-block
until_ok 30 is active
sleep 5
main=$(property MainPID)
kill -KILL "$main"
now >/vm/killed
until_ok 5 test ! -e "/proc/$main"
# All of the last minute's recordings: the newest is the one that was being written.
systemctl stop "$unit"
cp "$(ls -t /var/lib/arborcam/video0/*.mcap | head -1)" /vm/killed.mcap
journalctl -u "$unit" -o short-monotonic --no-pager >/vm/journal
pull_out
