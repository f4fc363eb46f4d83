# shellcheck shell=bash
# Sourced by scripts/test and scripts/test-long, for steps beside others that leave a processor idle in parts.
# Each has a process group of its own, which ends with the script.

declare -A beside=()
end_beside() {
  local group
  for group in "${beside[@]}"; do
    kill -- "-$group" 2>/dev/null || true
  done
}
trap end_beside EXIT

# begin NAME COMMAND ...: starts a command, whose output goes to target/NAME.log.
begin() {
  local name=$1
  shift
  mkdir -p target
  set -m
  "$@" </dev/null >"target/$name.log" 2>&1 &
  set +m
  beside[$name]=$!
}

# join NAME: waits for the command, prints its output, and returns its status.
join() {
  local status=0
  wait "${beside[$1]}" || status=$?
  unset "beside[$1]"
  cat "target/$1.log"
  return "$status"
}
