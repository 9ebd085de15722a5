#!/bin/sh
# Have a Chromium for the tests of the page, if this can be done quietly; else they are skipped.
for name in chromium chromium-browser google-chrome; do
    command -v "$name" >/dev/null 2>&1 && exit 0
done
if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null 2>&1; then
    export DEBIAN_FRONTEND=noninteractive
    if apt-get -qq update >/dev/null 2>&1 &&
        apt-get -qq install -y --no-install-recommends chromium >/dev/null 2>&1; then
        echo "asperity: installed chromium, for the tests of the page"
        exit 0
    fi
fi
echo "asperity: there is no chromium; the tests of the page in a browser are skipped"
