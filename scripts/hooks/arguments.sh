# Read by check.sh and diff.sh: `options` from the arguments before `--`, and the layouts behind it as arguments.
options=()
while [ $# -gt 0 ] && [ "$1" != -- ]; do
    options+=("$1")
    shift
done
[ $# -gt 0 ] || { echo "$(basename "$0"): give -- before the layouts" >&2; exit 2; }
shift
