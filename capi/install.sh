#!/bin/sh
# Installs the built library for C and C++ (Linux): install.sh FOLDER-OF-THE-BUILD PREFIX
# PREFIX may be moved afterwards: its files say where they are relative to each other.
set -eu
built=$1 prefix=$2
here=$(cd "$(dirname "$0")" && pwd)
version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/../Cargo.toml" | head -n 1)
# As in build.rs: before 1.0, a minor version may change the interface.
case $version in
0.*) interface=${version%.*} ;;
*) interface=${version%%.*} ;;
esac
shared=libsurefix.so.$version

mkdir -p "$prefix/include" "$prefix/lib/cmake/surefix" "$prefix/lib/pkgconfig"
cp "$here"/include/surefix.h "$here"/include/surefix.hpp "$prefix/include"
cp "$built/libsurefix_capi.a" "$prefix/lib/libsurefix.a"
# A program may be running with the old one: it is replaced, not written over.
cp "$built/libsurefix_capi.so" "$prefix/lib/.$shared"
mv -f "$prefix/lib/.$shared" "$prefix/lib/$shared"
ln -sf "$shared" "$prefix/lib/libsurefix.so.$interface"
ln -sf "libsurefix.so.$interface" "$prefix/lib/libsurefix.so"
fill() {
    sed -e "s/@VERSION@/$version/" -e "s/@INTERFACE@/$interface/" "$here/cmake/$1.in" >"$2/$1"
}
fill surefix.pc "$prefix/lib/pkgconfig"
fill surefixConfig.cmake "$prefix/lib/cmake/surefix"
fill surefixConfigVersion.cmake "$prefix/lib/cmake/surefix"
