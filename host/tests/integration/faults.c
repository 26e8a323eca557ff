/* Fails one file operation of a program, or sets its clock. Loaded with LD_PRELOAD by the tests.
 *
 *   FAULT_OP     open, write, rename, sync, unlink or mkdir
 *   FAULT_AT     which of them fails, from 1; with FAULT_ON also all later ones
 *   FAULT_ERRNO  with which error
 *   FAULT_UNDER  only files whose path contains this
 *   FAULT_CLOCK  the time of day, s since 1970
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

static int count;

static int fails(const char *op, const char *path) {
    const char *wanted = getenv("FAULT_OP"), *under = getenv("FAULT_UNDER");
    if (!wanted || strcmp(wanted, op) || !under || !path || !strstr(path, under)) return 0;
    int n = __sync_add_and_fetch(&count, 1), at = atoi(getenv("FAULT_AT"));
    if (n != at && !(n > at && getenv("FAULT_ON"))) return 0;
    dprintf(2, "fault: %s %s\n", op, path);
    errno = atoi(getenv("FAULT_ERRNO"));
    return 1;
}

static const char *path_of(int fd, char *path, size_t size) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, size - 1);
    path[length > 0 ? length : 0] = 0;
    return path;
}

#define NEXT(result, name, ...) \
    static result (*next)(__VA_ARGS__); \
    if (!next) next = (result(*)(__VA_ARGS__))dlsym(RTLD_NEXT, name)

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        va_list list; va_start(list, flags); mode_t mode = va_arg(list, mode_t); va_end(list); \
        NEXT(int, #name, const char *, int, ...); \
        if ((flags & (O_WRONLY | O_RDWR)) && fails("open", path)) return -1; \
        return next(path, flags, mode); \
    }
OPEN(open)
OPEN(open64)

ssize_t write(int fd, const void *bytes, size_t size) {
    char path[4096];
    NEXT(ssize_t, "write", int, const void *, size_t);
    if (fd > 2 && fails("write", path_of(fd, path, sizeof path))) return -1;
    return next(fd, bytes, size);
}

ssize_t writev(int fd, const struct iovec *parts, int many) {
    char path[4096];
    NEXT(ssize_t, "writev", int, const struct iovec *, int);
    if (fd > 2 && fails("write", path_of(fd, path, sizeof path))) return -1;
    return next(fd, parts, many);
}

int rename(const char *from, const char *to) {
    NEXT(int, "rename", const char *, const char *);
    return fails("rename", to) ? -1 : next(from, to);
}

int unlink(const char *path) {
    NEXT(int, "unlink", const char *);
    return fails("unlink", path) ? -1 : next(path);
}

int rmdir(const char *path) {
    NEXT(int, "rmdir", const char *);
    return fails("unlink", path) ? -1 : next(path);
}

int mkdir(const char *path, mode_t mode) {
    NEXT(int, "mkdir", const char *, mode_t);
    return fails("mkdir", path) ? -1 : next(path, mode);
}

int fdatasync(int fd) {
    char path[4096];
    NEXT(int, "fdatasync", int);
    return fails("sync", path_of(fd, path, sizeof path)) ? -1 : next(fd);
}

int fsync(int fd) {
    char path[4096];
    NEXT(int, "fsync", int);
    return fails("sync", path_of(fd, path, sizeof path)) ? -1 : next(fd);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    NEXT(int, "clock_gettime", clockid_t, struct timespec *);
    int result = next(clock, now);
    const char *set = getenv("FAULT_CLOCK");
    if (set && clock == CLOCK_REALTIME) now->tv_sec = atoll(set);
    return result;
}
