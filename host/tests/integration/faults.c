/* Fails one file operation of a program, kills it after a line of its journal, or sets its clock. Loaded with LD_PRELOAD by the tests.
 *
 *   FAULT_OP     open, write, rename, sync, unlink or mkdir
 *   FAULT_AT     which of them fails, from 1; with FAULT_ON also all later ones
 *   FAULT_ERRNO  with which error; `kill`: the program is killed before the operation
 *   FAULT_UNDER  only files whose path contains this
 *   FAULT_KILL   kills the program right after it has written a line of a journal that contains this, the one of number FAULT_AT
 *   FAULT_DISK   a folder that is to hold what a power cut leaves of FAULT_UNDER: files and names as they were when they were last
 *                synced, under their inode numbers (`f-N` a file, `d-N` a folder with lines of kind, inode and name)
 *   FAULT_CLOCK  the time of day, s since 1970
 */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
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

static void die(void) {
    kill(getpid(), SIGKILL);
    for (;;) pause();
}

static int fails(const char *op, const char *path) {
    const char *wanted = getenv("FAULT_OP"), *under = getenv("FAULT_UNDER");
    if (!wanted || strcmp(wanted, op) || !under || !path || !strstr(path, under)) return 0;
    int n = __sync_add_and_fetch(&count, 1), at = atoi(getenv("FAULT_AT"));
    if (n != at && !(n > at && getenv("FAULT_ON"))) return 0;
    dprintf(2, "fault: %s %s\n", op, path);
    if (!strcmp(getenv("FAULT_ERRNO"), "kill")) die();
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

static void kill_after(int fd, const void *bytes, size_t size) {
    char path[4096];
    const char *text = getenv("FAULT_KILL");
    if (!text || fd <= 2 || !strstr(path_of(fd, path, sizeof path), "journal.jsonl")) return;
    if (!memmem(bytes, size, text, strlen(text))) return;
    if (__sync_add_and_fetch(&count, 1) == atoi(getenv("FAULT_AT"))) die();
}

/* A file whose name is removed keeps its inode, so that no other gets its number. */
static void hold(const char *path) {
    if (getenv("FAULT_DISK")) (void)!fopen(path, "r");
}

/* Copies what has been synced. */
static void keep(int fd) {
    char path[4096], beside[4096], to[4096], entry[8192];
    const char *disk = getenv("FAULT_DISK"), *under = getenv("FAULT_UNDER");
    struct stat of;
    if (!disk || !strstr(path_of(fd, path, sizeof path), under) || fstat(fd, &of)) return;
    snprintf(beside, sizeof beside, "%s/%lu.tmp", disk, (unsigned long)of.st_ino);
    snprintf(to, sizeof to, "%s/%c-%lu", disk, S_ISDIR(of.st_mode) ? 'd' : 'f', (unsigned long)of.st_ino);
    FILE *out = fopen(beside, "w");
    if (!out) abort();
    if (S_ISDIR(of.st_mode)) {
        DIR *folder = opendir(path);
        struct dirent *one;
        while (folder && (one = readdir(folder))) {
            snprintf(entry, sizeof entry, "%s/%s", path, one->d_name);
            if (one->d_name[0] == '.' || lstat(entry, &of)) continue;
            fprintf(out, "%c %lu %s\n", S_ISDIR(of.st_mode) ? 'd' : 'f', (unsigned long)of.st_ino, one->d_name);
        }
        if (folder) closedir(folder);
    } else {
        FILE *in = fopen(path, "r");
        size_t many;
        while (in && (many = fread(entry, 1, sizeof entry, in)) > 0) fwrite(entry, 1, many, out);
        if (in) fclose(in);
    }
    fclose(out);
    rename(beside, to);
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
    ssize_t written = next(fd, bytes, size);
    kill_after(fd, bytes, size);
    return written;
}

ssize_t writev(int fd, const struct iovec *parts, int many) {
    char path[4096];
    NEXT(ssize_t, "writev", int, const struct iovec *, int);
    if (fd > 2 && fails("write", path_of(fd, path, sizeof path))) return -1;
    return next(fd, parts, many);
}

int rename(const char *from, const char *to) {
    NEXT(int, "rename", const char *, const char *);
    hold(to);
    return fails("rename", to) ? -1 : next(from, to);
}

int unlink(const char *path) {
    NEXT(int, "unlink", const char *);
    hold(path);
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
    if (fails("sync", path_of(fd, path, sizeof path))) return -1;
    int result = next(fd);
    if (!result) keep(fd);
    return result;
}

int fsync(int fd) {
    char path[4096];
    NEXT(int, "fsync", int);
    if (fails("sync", path_of(fd, path, sizeof path))) return -1;
    int result = next(fd);
    if (!result) keep(fd);
    return result;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    NEXT(int, "clock_gettime", clockid_t, struct timespec *);
    int result = next(clock, now);
    const char *set = getenv("FAULT_CLOCK");
    if (set && clock == CLOCK_REALTIME) now->tv_sec = atoll(set);
    return result;
}
