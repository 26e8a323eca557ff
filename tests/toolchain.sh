# Finds and installs the tools of tests/run and tests/firmware; sourced by both.
# shellcheck shell=bash

# Targets of the controller and of a controller without floating point.
targets=(thumbv7em-none-eabihf thumbv7m-none-eabi)

# Whether packages may be installed: as root with apt, unless DAMPRIG_INSTALL=no.
may_install() {
    [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null && [ "${DAMPRIG_INSTALL:-yes}" != no ]
}

# install PACKAGE…: installs packages, or names them and fails.
install() {
    if ! may_install; then
        echo "missing, please install: $*" >&2
        return 1
    fi
    echo "installing $*"
    export DEBIAN_FRONTEND=noninteractive
    if ! { apt-get update -qq && apt-get install -qq -y --no-install-recommends "$@"; } </dev/null >/tmp/damprig-apt.$$ 2>&1; then
        tail -5 /tmp/damprig-apt.$$ >&2
        rm -f /tmp/damprig-apt.$$
        echo "could not install $*" >&2
        return 1
    fi
    rm -f /tmp/damprig-apt.$$
}

rustup_has_targets() {
    local installed target
    command -v rustup >/dev/null || return 1
    installed=$(rustup target list --installed 2>/dev/null </dev/null)
    for target in "${targets[@]}"; do
        grep -qx "$target" <<<"$installed" || return 1
    done
}

distribution_has_source() {
    [ -x /usr/bin/cargo ] && [ -x /usr/bin/rustc ] && [ -x /usr/bin/cargo-clippy ] &&
        [ -d /usr/lib/rustlib/src/rust/library/core ] && command -v ld.lld >/dev/null
}

# Finds a compiler for the boards and defines `firmware_cargo COMMAND TARGET ARGUMENT…`: rustup's if it has the targets, else
# Debian's with the source of `core`. Downloads no toolchain.
find_firmware_compiler() {
    if rustup_has_targets; then
        compiler="rustup's $(rustc --version)"
        firmware_cargo() { cargo "$1" --target "$2" "${@:3}"; }
        return
    fi
    if ! distribution_has_source; then
        if ! install rustc-web cargo-web rust-web-src rust-web-clippy lld || ! distribution_has_source; then
            echo "no compiler for the boards: run \`rustup target add ${targets[*]}\`, or on Debian install" \
                "rustc-web cargo-web rust-web-src rust-web-clippy lld" >&2
            return 1
        fi
    fi
    compiler="Debian's $(/usr/bin/rustc --version), core built from source"
    firmware_cargo() {
        # Own home and target directory: the caches of the two cargos must not mix.
        PATH="/usr/bin:$PATH" RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1 RUSTUP_TOOLCHAIN='' \
            CARGO_HOME="${DAMPRIG_DEBIAN_CARGO_HOME:-$PWD/target/debian-home}" CARGO_TARGET_DIR="$PWD/target/debian" \
            CARGO_TARGET_THUMBV7EM_NONE_EABIHF_LINKER=ld.lld CARGO_TARGET_THUMBV7M_NONE_EABI_LINKER=ld.lld \
            /usr/bin/cargo "$1" -Zbuild-std=core --target "$2" "${@:3}"
    }
    firmware_output=target/debian
}

# QEMU for the emulated boards.
find_emulator() {
    command -v qemu-system-arm >/dev/null || install qemu-system-arm
}
firmware_output=target

# Build tools of the emulated STM32G474 (tests/board): cmake for Unicorn, libclang for its bindings.
find_board_tools() {
    local missing=()
    command -v cmake >/dev/null || missing+=(cmake)
    command -v pkg-config >/dev/null || missing+=(pkg-config)
    # libclang-cpp is another library.
    if [ -z "${LIBCLANG_PATH:-}" ] && ! compgen -G '/usr/lib/llvm-*/lib/libclang[.-][s0-9]*' >/dev/null &&
        ! ldconfig -p 2>/dev/null | grep -Eq 'libclang(-[0-9.]+)?\.so'; then
        missing+=(libclang-dev)
    fi
    [ ${#missing[@]} = 0 ] || install "${missing[@]}"
}

# A Python in target/python with the packages of tests/python/requirements.txt, which read exports and judge files by schemas.
find_python() {
    local wanted=tests/python/requirements.txt
    if ! cmp -s "$wanted" target/python/requirements.txt; then
        if ! command -v python3 >/dev/null || ! python3 -c 'import ensurepip' 2>/dev/null; then
            install python3 python3-venv || return 1
        fi
        rm -rf target/python
        python3 -m venv target/python
        if ! target/python/bin/pip install --quiet --disable-pip-version-check -r "$wanted" </dev/null; then
            echo "could not install $(grep -v '^#' "$wanted" | tr '\n' ' ')from PyPI into target/python" >&2
            return 1
        fi
        cp "$wanted" target/python/requirements.txt
    fi
    target/python/bin/python --version
}

# mdBook, which builds the manual (book.toml): this version, in target/tools.
mdbook_version=0.5.4
find_mdbook() {
    [ "$(target/tools/bin/mdbook --version 2>/dev/null)" = "mdbook v$mdbook_version" ] && return
    cargo install --quiet --locked --root target/tools --version "$mdbook_version" mdbook
}
