#!/usr/bin/env bash
# Certifies a robot in a CI job, and leaves what CI systems show. `pip install` of the suite puts it on PATH as roaas-ci.
#
# Everything comes from the environment, so that no job ever pastes a value into a script:
#   ROAAS_STATEMENT         the robot's implementation conformance statement (a file)
#   ROAAS_URL               address of the device's own description, or of its WSDL: no statement is needed then
#   ROAAS_CALL              what may be called beside what reads, as --call has it: a pattern in each line
#   ROAAS_REST, ROAAS_PUBLISHERS_WSDL, ROAAS_SUBSCRIBERS_WSDL    its addresses, where the statement does not name them
#   ROAAS_PROFILE           paper or full
#   ROAAS_CLASSES           conformance classes, with blanks in between
#   ROAAS_ALLOW_MOTION      true or false: whether the robot may be moved
#   ROAAS_EFFORT            quick, standard or deep
#   ROAAS_SEED, ROAAS_TIMEOUT, ROAAS_BASELINE                    as the options of `roaas certify`
#   ROAAS_TOKEN             the robot's bearer token; it reaches the suite as a file that only this user can read
#   ROAAS_OUT               folder for the results (roaas-results)
#   ROAAS_COMMAND           the suite's command (roaas)
#
# The exit code is that of `roaas certify`: all but 0 make the job red.
set -euo pipefail

case ${1:-} in
    "") ;;
    -h | --help)
        sed -n '2,/^# The exit code/s/^# \{0,1\}//p' -- "${BASH_SOURCE[0]}"
        exit 0
        ;;
    *)
        echo "roaas-ci takes no arguments, such as '$1': set ROAAS_URL or ROAAS_STATEMENT, and see roaas-ci --help" >&2
        exit 2
        ;;
esac
if [[ -z ${ROAAS_STATEMENT:-}${ROAAS_URL:-}${ROAAS_REST:-}${ROAAS_PUBLISHERS_WSDL:-}${ROAAS_SUBSCRIBERS_WSDL:-} ]]; then
    echo "no robot is named: set ROAAS_URL to the address of its description, or ROAAS_STATEMENT to a file" >&2
    exit 2
fi

out=${ROAAS_OUT:-roaas-results}
read -r -a roaas <<<"${ROAAS_COMMAND:-roaas}"
options=(--out "$out")

add() { # NAME VALUE: an option where there is a value
    if [[ -n $2 ]]; then options+=("--$1=$2"); fi
}
add rest "${ROAAS_REST:-}"
add publishers-wsdl "${ROAAS_PUBLISHERS_WSDL:-}"
add subscribers-wsdl "${ROAAS_SUBSCRIBERS_WSDL:-}"
add profile "${ROAAS_PROFILE:-}"
add effort "${ROAAS_EFFORT:-}"
add seed "${ROAAS_SEED:-}"
add timeout "${ROAAS_TIMEOUT:-}"
add baseline "${ROAAS_BASELINE:-}"
read -r -a classes <<<"${ROAAS_CLASSES:-}"
for class in "${classes[@]+"${classes[@]}"}"; do add class "$class"; done
case ${ROAAS_ALLOW_MOTION:-false} in
    true) options+=(--allow-motion) ;;
    false) ;;
    *)
        echo "ROAAS_ALLOW_MOTION is '$ROAAS_ALLOW_MOTION': it has to be true or false" >&2
        exit 2
        ;;
esac
while IFS= read -r pattern; do add call "$pattern"; done <<<"${ROAAS_CALL:-}"
options+=(--)
for target in "${ROAAS_STATEMENT:-}" "${ROAAS_URL:-}"; do
    if [[ -n $target ]]; then options+=("$target"); fi
done

# What an earlier run left is not taken for this one's.
mkdir -p -- "$out"
rm -f -- "$out"/{result.json,certificate.{html,md,intoto.json},certificate-print.html,junit.xml}
rm -f -- "$out"/{roaas.sarif,ctrf-report.json,gl-code-quality-report.json,badge.json,annotations.txt}

private=$(mktemp -d)
trap 'rm -rf -- "$private"' EXIT
if [[ -n ${ROAAS_TOKEN:-} ]]; then
    (umask 077 && printf '%s\n' "$ROAAS_TOKEN" >"$private/token")
    options=(--token-file "$private/token" "${options[@]}")
fi
unset ROAAS_TOKEN

# On GitHub a line that begins with "::" is a command: what a robot says shall be none.
guard=""
if [[ ${GITHUB_ACTIONS:-} == true ]]; then
    guard=$(od -An -N16 -tx1 /dev/urandom | tr -d ' \n')
    echo "::stop-commands::$guard"
fi
code=0
"${roaas[@]}" certify "${options[@]}" || code=$?
if [[ -n $guard ]]; then echo "::$guard::"; fi

if [[ -f $out/result.json ]]; then
    formats=()
    for name in sarif ctrf gitlab junit markdown badge annotations; do formats+=(--format "$name"); done
    # A result that cannot be shown is no green one.
    "${roaas[@]}" report "$out" "${formats[@]}" >/dev/null || { [[ $code != 0 ]] || code=2; }
fi
if [[ -n $guard && -f $out/annotations.txt ]]; then cat -- "$out/annotations.txt"; fi
if [[ -n ${GITHUB_STEP_SUMMARY:-} ]]; then
    if [[ -f $out/certificate.md ]]; then
        cat -- "$out/certificate.md" >>"$GITHUB_STEP_SUMMARY"
    else
        echo "RoAAS left no result: it ended with exit code $code, and the log says why." >>"$GITHUB_STEP_SUMMARY"
    fi
fi
if [[ -n ${GITHUB_OUTPUT:-} ]]; then echo "exit-code=$code" >>"$GITHUB_OUTPUT"; fi
exit "$code"
