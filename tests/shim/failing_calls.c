/* A library for LD_PRELOAD that counts the calls of libc with which a process changes files below a
 * folder, and lets one of them fail or kills the process there. tests/it/failing_calls.rs uses it.
 *
 *   SHIM_FOLDER   the folder, as the process names it
 *   SHIM_REPORT   file outside of the folder to which the names of all counted calls are appended
 *   SHIM_AT       number of the call at which something happens, from 1; 0: nothing
 *   SHIM_ACTION   kill: SIGKILL before the call; after: SIGKILL after the call; short: half of a write,
 *                 then SIGKILL (any other call: as after); a number: the call fails with this errno
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/sendfile.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_int calls;

/* The next definition of a function, in libc. */
#define NEXT(type, name, ...) \
    static type (*next)(__VA_ARGS__); \
    if (!next) next = (type (*)(__VA_ARGS__))dlsym(RTLD_NEXT, name)

static int is_below(const char *path) {
    const char *folder = getenv("SHIM_FOLDER");
    size_t length = folder ? strlen(folder) : 0;
    return length && path && !strncmp(path, folder, length) && (path[length] == '/' || !path[length]);
}

static int path_at(int directory, const char *path, char *out) {
    char link[64];
    out[0] = 0;
    if (directory != AT_FDCWD && path[0] != '/') {
        snprintf(link, sizeof link, "/proc/self/fd/%d", directory);
        ssize_t length = readlink(link, out, PATH_MAX - 1);
        if (length < 0) return 0;
        out[length] = 0;
        if (path[0] && length + 1 < PATH_MAX) {
            out[length] = '/';
            out[length + 1] = 0;
        }
    }
    strncat(out, path, PATH_MAX - 1 - strlen(out));
    return is_below(out);
}


static void report(const char *name, const char *path) {
    const char *report = getenv("SHIM_REPORT");
    if (!report) return;
    char line[PATH_MAX + 64];
    int length = snprintf(line, sizeof line, "%s %s\n", name, path);
    int file = syscall(SYS_openat, AT_FDCWD, report, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (file < 0) return;
    if (syscall(SYS_write, file, line, length) < 0) abort();
    syscall(SYS_close, file);
}

enum action { PASS, FAIL, KILL_AFTER, SHORT };

static void kill_process(void) {
    kill(getpid(), SIGKILL);
    for (;;) pause();
}

/* What happens to this call. */
static enum action count(const char *name, const char *path) {
    const char *at = getenv("SHIM_AT"), *action = getenv("SHIM_ACTION");
    int number = ++calls;
    report(name, path);
    if (!at || atoi(at) != number || !action) return PASS;
    if (!strcmp(action, "kill")) kill_process();
    if (!strcmp(action, "after")) return KILL_AFTER;
    if (!strcmp(action, "short")) return SHORT;
    errno = atoi(action);
    return FAIL;
}

static enum action count_file(const char *name, int file) {
    char path[PATH_MAX];
    int saved = errno;
    if (file < 0 || !path_at(file, "", path)) {
        errno = saved;
        return PASS;
    }
    return count(name, path);
}

static enum action count_path(const char *name, int directory, const char *path) {
    char full[PATH_MAX];
    int saved = errno;
    if (!path_at(directory, path, full)) {
        errno = saved;
        return PASS;
    }
    return count(name, full);
}

#define END_OF_CALL(type, action, call) \
    do { \
        if (action == FAIL) return -1; \
        type result = call; \
        if (action != PASS) kill_process(); \
        return result; \
    } while (0)

static int changes(int flags) {
    return (flags & O_ACCMODE) != O_RDONLY || flags & (O_CREAT | O_TRUNC);
}

#define DEFINE_OPEN(name) \
    int name(const char *path, int flags, ...) { \
        va_list list; \
        va_start(list, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(list, mode_t) : 0; \
        va_end(list); \
        NEXT(int, #name, const char *, int, ...); \
        enum action action = changes(flags) ? count_path(#name, AT_FDCWD, path) : PASS; \
        END_OF_CALL(int, action, next(path, flags, mode)); \
    }
DEFINE_OPEN(open)
DEFINE_OPEN(open64)

#define DEFINE_OPENAT(name) \
    int name(int directory, const char *path, int flags, ...) { \
        va_list list; \
        va_start(list, flags); \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(list, mode_t) : 0; \
        va_end(list); \
        NEXT(int, #name, int, const char *, int, ...); \
        enum action action = changes(flags) ? count_path(#name, directory, path) : PASS; \
        END_OF_CALL(int, action, next(directory, path, flags, mode)); \
    }
DEFINE_OPENAT(openat)
DEFINE_OPENAT(openat64)

#define DEFINE_CREAT(name) \
    int name(const char *path, mode_t mode) { \
        NEXT(int, #name, const char *, mode_t); \
        enum action action = count_path(#name, AT_FDCWD, path); \
        END_OF_CALL(int, action, next(path, mode)); \
    }
DEFINE_CREAT(creat)
DEFINE_CREAT(creat64)
DEFINE_CREAT(mkdir)

ssize_t write(int file, const void *bytes, size_t size) {
    NEXT(ssize_t, "write", int, const void *, size_t);
    enum action action = count_file("write", file);
    END_OF_CALL(ssize_t, action, next(file, bytes, action == SHORT ? size / 2 : size));
}

#define DEFINE_PWRITE(name, offset_type) \
    ssize_t name(int file, const void *bytes, size_t size, offset_type offset) { \
        NEXT(ssize_t, #name, int, const void *, size_t, offset_type); \
        enum action action = count_file(#name, file); \
        END_OF_CALL(ssize_t, action, next(file, bytes, action == SHORT ? size / 2 : size, offset)); \
    }
DEFINE_PWRITE(pwrite, off_t)
DEFINE_PWRITE(pwrite64, off64_t)

ssize_t writev(int file, const struct iovec *parts, int part_count) {
    NEXT(ssize_t, "writev", int, const struct iovec *, int);
    enum action action = count_file("writev", file);
    END_OF_CALL(ssize_t, action, next(file, parts, action == SHORT ? (part_count + 1) / 2 : part_count));
}

#define DEFINE_SYNC(name) \
    int name(int file) { \
        NEXT(int, #name, int); \
        enum action action = count_file(#name, file); \
        END_OF_CALL(int, action, next(file)); \
    }
DEFINE_SYNC(fsync)
DEFINE_SYNC(fdatasync)

#define DEFINE_FTRUNCATE(name, length_type) \
    int name(int file, length_type length) { \
        NEXT(int, #name, int, length_type); \
        enum action action = count_file(#name, file); \
        END_OF_CALL(int, action, next(file, length)); \
    }
DEFINE_FTRUNCATE(ftruncate, off_t)
DEFINE_FTRUNCATE(ftruncate64, off64_t)

int rename(const char *old, const char *new) {
    NEXT(int, "rename", const char *, const char *);
    enum action action = count_path("rename", AT_FDCWD, new);
    END_OF_CALL(int, action, next(old, new));
}

int renameat(int old_directory, const char *old, int directory, const char *new) {
    NEXT(int, "renameat", int, const char *, int, const char *);
    enum action action = count_path("renameat", directory, new);
    END_OF_CALL(int, action, next(old_directory, old, directory, new));
}

int renameat2(int old_directory, const char *old, int directory, const char *new, unsigned flags) {
    NEXT(int, "renameat2", int, const char *, int, const char *, unsigned);
    enum action action = count_path("renameat2", directory, new);
    END_OF_CALL(int, action, next(old_directory, old, directory, new, flags));
}

#define DEFINE_REMOVE(name) \
    int name(const char *path) { \
        NEXT(int, #name, const char *); \
        enum action action = count_path(#name, AT_FDCWD, path); \
        END_OF_CALL(int, action, next(path)); \
    }
DEFINE_REMOVE(unlink)
DEFINE_REMOVE(rmdir)

int unlinkat(int directory, const char *path, int flags) {
    NEXT(int, "unlinkat", int, const char *, int);
    enum action action = count_path("unlinkat", directory, path);
    END_OF_CALL(int, action, next(directory, path, flags));
}

int link(const char *old, const char *new) {
    NEXT(int, "link", const char *, const char *);
    enum action action = count_path("link", AT_FDCWD, new);
    END_OF_CALL(int, action, next(old, new));
}

int linkat(int old_directory, const char *old, int directory, const char *new, int flags) {
    NEXT(int, "linkat", int, const char *, int, const char *, int);
    enum action action = count_path("linkat", directory, new);
    END_OF_CALL(int, action, next(old_directory, old, directory, new, flags));
}

ssize_t copy_file_range(int in, off64_t *in_at, int out, off64_t *out_at, size_t size, unsigned flags) {
    NEXT(ssize_t, "copy_file_range", int, off64_t *, int, off64_t *, size_t, unsigned);
    enum action action = count_file("copy_file_range", out);
    END_OF_CALL(ssize_t, action, next(in, in_at, out, out_at, action == SHORT ? size / 2 : size, flags));
}

#define DEFINE_SENDFILE(name, offset_type) \
    ssize_t name(int out, int in, offset_type *offset, size_t size) { \
        NEXT(ssize_t, #name, int, int, offset_type *, size_t); \
        enum action action = count_file(#name, out); \
        END_OF_CALL(ssize_t, action, next(out, in, offset, action == SHORT ? size / 2 : size)); \
    }
DEFINE_SENDFILE(sendfile, off_t)
DEFINE_SENDFILE(sendfile64, off64_t)
