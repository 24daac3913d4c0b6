#!/bin/sh
# Makes the running system take notice of what `make install` or `make uninstall` has changed. Each part is skipped
# where there is nothing to tell: in a container, or without systemd or udev.
set -u

told=
if command -v systemd-sysusers >/dev/null; then systemd-sysusers && told="$told users"; fi
if command -v systemd-tmpfiles >/dev/null && [ -n "$(find /usr/lib/tmpfiles.d -name arborcam.conf)" ]; then
    systemd-tmpfiles --create arborcam.conf && told="$told folders"
fi
if [ -d /run/systemd/system ]; then systemctl daemon-reload && told="$told units"; fi
if [ -e /run/udev/control ]; then
    udevadm control --reload && udevadm trigger --subsystem-match=video4linux && told="$told devices"
fi
echo "activate: the system has read anew:${told:- nothing, it will at its next start}"
