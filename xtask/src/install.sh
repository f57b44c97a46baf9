#!/bin/sh
# Installs seedbed from this directory: `./install.sh [PREFIX]`. PREFIX is ~/.local unless it is given.
set -eu
cd "$(dirname "$0")"
prefix="${1:-$HOME/.local}"
mkdir -p "$prefix"
cp -R bin share "$prefix/"
echo "installed $prefix/bin/seedbed"
case ":$PATH:" in
    *":$prefix/bin:"*) ;;
    *) echo "add $prefix/bin to PATH to run it as seedbed" ;;
esac
