# shellcheck shell=bash
# To be sourced by scripts that try something on a bare Debian, a chroot that is removed at their end:
#
#   bare_debian SUITE [FLAG...]     makes it, with these flags of debootstrap; $system is its folder
#   fail TEXT                       ends with an error
#
# Needs root and debootstrap. What a script mounts below $system is unmounted before that is removed.
fail() {
    printf 'error: %s\n' "$1" >&2
    exit 1
}

bare_debian() {
    local suite=$1 log
    shift
    ((EUID == 0)) || fail "a chroot needs root"
    command -v debootstrap >/dev/null || fail "debootstrap is missing: apt install debootstrap"
    system=$(mktemp -d)
    trap remove_bare_debian EXIT
    log=$(debootstrap --variant=minbase "$@" "$suite" "$system" 2>&1) || fail "debootstrap: $(tail -n 20 <<<"$log")"
    mount -t proc proc "$system/proc"
    mount --bind /dev "$system/dev"
}

remove_bare_debian() {
    local mounted
    # Before anything is removed: these folders are those of this system. The last one first.
    while read -r mounted; do umount "$mounted"; done < <(
        cut -d ' ' -f 5 /proc/self/mountinfo | grep "^$system/" | tac
    )
    rm -rf --one-file-system "$system"
}
