#!/usr/bin/env bash
# Installs mapforest on a payload: program, user, units, udev rules, sysctl. Safe to run again: it only changes
# what differs. Uninstalling leaves recordings and configuration alone.
#
#   sudo systemd/install.sh --recordings /mnt/card      install, record onto the card
#   sudo systemd/install.sh --console tty1              also show the operator screen on the first console
#   sudo systemd/install.sh --dry-run                   say what would be done, change nothing
#   sudo systemd/install.sh --uninstall                 take program, units, rules and sysctl away again
set -euo pipefail

here=$(cd "$(dirname "$0")" && pwd)
source_tree=$(dirname "$here")
root=""        # --root DIR: install below DIR, for an image or a test; users and services are left alone there
recordings=/var/lib/mapforest/recordings
console=""
action=install
dry_run=false

usage() { sed -n '2,8p' "$0" | sed 's/^# \{0,1\}//'; }
fail() { echo "install.sh: $*" >&2; exit 1; }
wrong() { echo "install.sh: $*" >&2; usage >&2; exit 2; }

while [ $# -gt 0 ]; do
  case $1 in
    --recordings) recordings=${2:?--recordings needs a folder}; shift ;;
    --console) console=${2:?--console needs a terminal, such as tty1}; shift ;;
    --root) root=${2:?--root needs a folder}; shift ;;
    --dry-run) dry_run=true ;;
    --uninstall) action=uninstall ;;
    -h|--help) usage; exit 0 ;;
    *) wrong "unknown option $1" ;;
  esac
  shift
done
case $recordings in /*) ;; *) wrong "--recordings needs an absolute path, not $recordings" ;; esac

# Every change goes through `run`, so that --dry-run is honest by construction.
run() {
  echo "+ $*"
  $dry_run || "$@"
}

live() { [ -z "$root" ]; }

systemd_runs() { live && [ -d /run/systemd/system ]; }

# copy SOURCE TARGET MODE: only when it differs
copy() {
  if cmp -s "$1" "$root$2"; then echo "= $2 is up to date"; else run install -D -m "$3" "$1" "$root$2"; fi
}

# write TARGET MODE: content on standard input, only when it differs
write() {
  local content
  content=$(mktemp)
  cat > "$content"
  copy "$content" "$1" "$2"
  rm -f "$content"
}

remove() {
  if [ -e "$root$1" ]; then run rm -rf "$root$1"; else echo "= $1 is not there"; fi
}

check_machine() {
  live || return 0
  $dry_run || [ "$(id -u)" = 0 ] || fail "needs root: run it with sudo"
  python3 -c 'import sys; sys.exit(sys.version_info < (3, 10))' || fail "needs Python 3.10 or later as python3"
  python3 -c 'import venv, ensurepip' 2>/dev/null || fail "needs the venv module: apt install python3-venv"
}

install_user() {
  live || return 0
  if id mapforest >/dev/null 2>&1; then echo "= user mapforest exists"; return; fi
  run useradd --system --user-group --home-dir /var/lib/mapforest --no-create-home --shell /usr/sbin/nologin mapforest
}

install_program() {
  live || { echo "= program: not installed below --root"; return 0; }
  local pins=/opt/mapforest/installed-requirements.txt
  [ -x /opt/mapforest/venv/bin/python ] || run python3 -m venv /opt/mapforest/venv
  if ! cmp -s "$source_tree/requirements/run.txt" "$pins"; then
    run /opt/mapforest/venv/bin/pip install --quiet --require-hashes --requirement "$source_tree/requirements/run.txt"
    run install -m 0644 "$source_tree/requirements/run.txt" "$pins"
  fi
  run /opt/mapforest/venv/bin/pip install --quiet --no-deps --no-build-isolation --force-reinstall "$source_tree"
  run /opt/mapforest/venv/bin/python -m compileall -q /opt/mapforest/venv/lib
}

install_configuration() {
  if [ -e "$root/etc/mapforest/mapforest.toml" ]; then
    echo "= /etc/mapforest/mapforest.toml is kept as it is"
  else
    sed "s|^folder = .*|folder = \"$recordings\"|" "$source_tree/edge/mapforest.toml" | write /etc/mapforest/mapforest.toml 0644
  fi
  # ProtectSystem=strict leaves the recorder one more place to write to, and only while the card is there.
  write /etc/systemd/system/mapforest-recorder.service.d/recordings.conf 0644 <<EOF
[Unit]
RequiresMountsFor=$recordings
[Service]
ReadWritePaths=$recordings
EOF
  [ -d "$root$recordings" ] || run install -d -m 2770 "$root$recordings"
  ! live || run chown mapforest:mapforest "$recordings"
}

install_units() {
  copy "$here/mapforest-recorder.service" /etc/systemd/system/mapforest-recorder.service 0644
  copy "$here/mapforest-pipeline.service" /etc/systemd/system/mapforest-pipeline.service 0644
  copy "$here/mapforest-tui@.service" /etc/systemd/system/mapforest-tui@.service 0644
  copy "$here/90-mapforest.rules" /etc/udev/rules.d/90-mapforest.rules 0644
  copy "$here/90-mapforest.conf" /etc/sysctl.d/90-mapforest.conf 0644
  copy "$source_tree/README.md" /opt/mapforest/share/README.md 0644
}

activate() {
  systemd_runs || { echo "= systemd does not run here: nothing is started"; return 0; }
  run systemctl daemon-reload
  run sysctl --quiet --load /etc/sysctl.d/90-mapforest.conf
  run udevadm control --reload
  run udevadm trigger --subsystem-match=tty
  run systemctl enable mapforest-recorder.service mapforest-pipeline.service
  run systemctl restart mapforest-recorder.service mapforest-pipeline.service
  [ -z "$console" ] || run systemctl enable --now "mapforest-tui@$console.service"
}

uninstall() {
  if systemd_runs; then
    run systemctl disable --now mapforest-pipeline.service || true
    run systemctl disable --now mapforest-recorder.service || true
    run systemctl disable --now 'mapforest-tui@*.service' || true
  fi
  remove /etc/systemd/system/mapforest-recorder.service
  remove /etc/systemd/system/mapforest-pipeline.service
  remove /etc/systemd/system/mapforest-recorder.service.d
  remove /etc/systemd/system/mapforest-tui@.service
  remove /etc/udev/rules.d/90-mapforest.rules
  remove /etc/sysctl.d/90-mapforest.conf
  remove /opt/mapforest
  ! systemd_runs || run systemctl daemon-reload
  echo "= kept: /etc/mapforest, the recordings, and the user mapforest"
}

if [ "$action" = uninstall ]; then
  ! live || $dry_run || [ "$(id -u)" = 0 ] || fail "needs root: run it with sudo"
  uninstall
else
  check_machine
  install_user
  install_program
  install_units
  install_configuration
  activate
  echo "= done. Look: systemctl status mapforest-recorder; mapforest doctor"
fi
