#!/usr/bin/env bash
# Makes the virtual machine of the V4L2 tests under target/vm: Debian's own kernel, v4l2loopback built for it, QEMU, and
# what the guest needs beyond this machine's programs. Debian packages are unpacked there; none is installed. A second
# call finds all in place. Needs no root, unless apt's lists have to be fetched first.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
vm=$root/target/vm

# Module packages follow the kernel's version; see download_kernel.
qemu_packages=(qemu-system-x86)
tool_packages=(busybox-static cpio kmod zstd)
guest_packages=(systemd udev kmod tmux v4l-utils)
# Must be of one version among themselves, whatever this machine has of them.
guest_whole=(systemd udev libsystemd-shared libsystemd0 libudev1)
# The first line is what finds the root file system, the second what the tests use.
boot_modules=(virtio_pci virtio_rng 9pnet_virtio 9p overlay)
test_modules=(vivid v4l2loopback uvcvideo vhci-hcd autofs4 configfs)

fail() {
    printf 'vm: %s\n' "$*" >&2
    exit 1
}

# What is made depends on these files; a cache of other contents is made anew.
stamp() {
    cat "$here/prepare.sh" "$here/init" | sha256sum | cut -d' ' -f1
}

check_machine() {
    local tool
    [[ $(uname -sm) == "Linux x86_64" ]] || fail "only Linux on x86_64 can run the virtual machine, this is $(uname -sm)"
    for tool in apt-get apt-cache dpkg-deb dpkg-query make gcc; do
        command -v "$tool" >/dev/null ||
            fail "$tool is missing; the virtual machine is made from Debian packages on Debian or Ubuntu (scripts/setup.sh)"
    done
}

candidate() {
    apt-cache policy "$1" 2>/dev/null | sed -n 's/^ *Candidate: //p' | grep -v '(none)'
}

refresh_lists() {
    ((EUID == 0)) || fail "$1; as root run: apt-get update"
    echo "vm: fetching apt's lists"
    apt-get -qq update || fail "apt-get update fails; check the network"
}

# Everything that the packages need and this machine lacks: resolved as if nothing were installed, so that apt cannot
# want to remove what is in its way, and then without what is there.
missing_of() {
    apt-get -s -o Dir::State::status=/dev/null --no-install-recommends install "$@" 2>/dev/null |
        awk '$1 == "Inst" {print $2}' | sort -u |
        comm -23 - <(dpkg-query -W -f='${db:Status-Status} ${Package}\n' | awk '$1 == "installed" {print $2}' | sort -u)
}

# Into debs/NAME, in one go; once more with new lists where the old ones name versions that are gone.
download() {
    local into=$work/debs/$1
    shift
    mkdir -p "$into"
    (cd "$into" && apt-get -qq -o APT::Sandbox::User=root download "$@") && return
    refresh_lists "some of $* cannot be downloaded"
    (cd "$into" && apt-get -qq -o APT::Sandbox::User=root download "$@") || fail "cannot download some of: $*"
}

# As /usr merges them: a folder lib/ in a layer would hide the guest's link of that name.
unpack() {
    local from=$work/debs/$1 into=$2 deb part
    mkdir -p "$into"
    for deb in "$from"/*.deb; do
        dpkg-deb -x "$deb" "$into"
    done
    for part in bin sbin lib lib64; do
        if [[ -d $into/$part && ! -L $into/$part ]]; then
            mkdir -p "$into/usr/$part"
            cp -a "$into/$part/." "$into/usr/$part/"
            rm -rf "${into:?}/$part"
        fi
    done
}

download_kernel() {
    local image common
    image=$(apt-cache depends linux-image-amd64 | sed -n 's/^ *Depends: \(linux-image-[0-9].*\)/\1/p' | head -1)
    [[ -n $image ]] || fail "linux-image-amd64 names no kernel here; a Debian release is needed"
    release=${image#linux-image-}
    common=linux-headers-${release%-amd64}-common
    # The unsigned twin holds the same kernel, where the signed one is not to be had.
    build=$(apt-cache depends "linux-headers-$release" | sed -n 's/^ *Depends: \(linux-kbuild.*\|linux-compiler.*\)/\1/p')
    # shellcheck disable=SC2086 # one word a package
    download kernel "$image" "linux-headers-$release" "$common" $build v4l2loopback-dkms
    unpack kernel "$work/kernel"
}

build_loopback() {
    local headers=$work/kernel/usr/src/linux-headers-$release source=$work/v4l2loopback
    cp -r "$work"/kernel/usr/src/v4l2loopback-*/. "$source"
    # The headers name each other by where they would be installed.
    grep -rlIs '/usr/src\|/usr/lib/linux-kbuild' "$headers" --include=Makefile --include=.kernelvariables |
        xargs -r sed -i "s#/usr/src/#$work/kernel/usr/src/#g; s#/usr/lib/linux-kbuild#$work/kernel/usr/lib/linux-kbuild#g"
    # The headers' own programs may need a library that is only among the tools.
    LD_LIBRARY_PATH=$work/tools/usr/lib/x86_64-linux-gnu make -s -C "$headers" M="$source" KERNELRELEASE="$release" modules >"$work/v4l2loopback.log" 2>&1 ||
        { tail -20 "$work/v4l2loopback.log" >&2; fail "v4l2loopback cannot be built for $release"; }
    install -D "$source/v4l2loopback.ko" "$work/kernel/usr/lib/modules/$release/extra/v4l2loopback.ko"
}

tool() {
    local name=$1
    shift
    if command -v "$name" >/dev/null; then "$name" "$@"; else
        LD_LIBRARY_PATH=$work/tools/usr/lib/x86_64-linux-gnu "$(find "$work/tools/usr" -name "$name" -path '*bin/*' | head -1)" "$@"
    fi
}

# The modules with what they need, in the order of loading.
module_files() {
    tool modprobe -d "$work/kernel/usr" -S "$release" --show-depends -a "$@" | awk '$1 == "insmod" {print $2}' | awk '!seen[$0]++'
}

make_modules() {
    local file all=$work/kernel/usr/lib/modules/$release keep=$work/guest/usr/lib/modules/$release
    # kmod looks for lib/modules below the folder that it is told.
    tool depmod -b "$work/kernel/usr" "$release"
    module_files "${test_modules[@]}" | while read -r file; do
        install -D -m644 "$file" "$keep/${file#*"/lib/modules/$release/"}"
    done
    cp "$all"/modules.{order,builtin,builtin.modinfo} "$keep/"
    tool depmod -b "$work/guest/usr" "$release"
}

make_initramfs() {
    local tree=$work/initramfs file n=10
    mkdir -p "$tree"/{bin,modules,proc,sys,dev,host,guest,layer,root}
    install -m755 "$work/tools/usr/bin/busybox" "$tree/bin/busybox"
    install -m755 "$here/init" "$tree/init"
    module_files "${boot_modules[@]}" | while read -r file; do
        cp "$file" "$tree/modules/$n-$(basename "$file")"
        n=$((n + 1))
    done
    (cd "$tree" && find . -print0 | tool cpio --null -o -H newc --quiet --owner=0:0) | tool zstd -q -3 -f -o "$work/initramfs.img"
}

record_versions() {
    local deb
    echo "kernel $release"
    for deb in "$work"/debs/*/*.deb; do
        dpkg-deb -W --showformat='${Package} ${Version}\n' "$deb"
    done | sort -u
}

check_machine
want=$(stamp)
if [[ -e $vm/ready && $(<"$vm/ready") == "$want" ]]; then
    echo "vm: $vm is ready, $(head -1 "$vm/versions.txt")"
    exit 0
fi
for package in linux-image-amd64 qemu-system-x86 v4l2loopback-dkms busybox-static; do
    [[ -n $(candidate "$package") ]] || { refresh_lists "apt knows no $package"; break; }
done

work=$vm.new
trap 'rm -rf "$work"' EXIT
rm -rf "$work"
mkdir -p "$work"
release= build=
echo "vm: downloading and unpacking Debian packages (once, some 150 MB)"
# shellcheck disable=SC2046 # one word a package
{
    download_kernel
    download qemu "${qemu_packages[@]}" $(missing_of "${qemu_packages[@]}")
    download tools "${tool_packages[@]}" $(missing_of "${tool_packages[@]}" $(tr ' ' '\n' <<<$build | grep kbuild))
    download guest "${guest_whole[@]}" $(missing_of "${guest_packages[@]}")
}
unpack qemu "$work/qemu"
unpack tools "$work/tools"
# Links to /bin/kmod, as it would be installed.
ln -sfn ../bin/kmod "$work/tools/usr/sbin/modprobe"
ln -sfn ../bin/kmod "$work/tools/usr/sbin/depmod"
unpack guest "$work/guest"
build_loopback
make_modules
make_initramfs
cp "$work/kernel/boot/vmlinuz-$release" "$work/vmlinuz"
record_versions >"$work/versions.txt"
rm -rf "$work"/{debs,kernel,v4l2loopback,initramfs,tools}
rm -f "$work"/*.log
echo "$want" >"$work/ready"
rm -rf "$vm"
mv "$work" "$vm"
echo "vm: made $vm, $(head -1 "$vm/versions.txt")"
