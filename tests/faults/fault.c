/* Makes one call to the file system fail, or kills the process just before it: a library for LD_PRELOAD.
 *
 * It counts, in one process, the calls below a folder that open, write, sync, rename, link, remove, lock or change files or
 * folders. Settings come from the environment:
 *
 *   FAULT_BELOW  the folder, an absolute path without a link in it
 *   FAULT_AT     number of the call that fails, from 1; none does without it
 *   FAULT_ERRNO  the error it fails with; 0 kills the process instead
 *   FAULT_SAY    a file to which go the call that failed and, at the end, how many calls there were
 *
 * It sees calls of the C library's functions, not raw system calls.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum { LONGEST = 4096 };

static char below[LONGEST];
static size_t below_length;
static long fails_at;
static int fails_with;
static const char *say_to;
static atomic_long calls;

/* Finds the function that a name of this library stands before. */
static void *behind(const char *name) {
    void *function = dlsym(RTLD_NEXT, name);
    if (!function) abort();
    return function;
}

static void say(const char *format, ...) {
    if (!say_to) return;
    char line[LONGEST + 64];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (length >= (int)sizeof line) length = sizeof line - 1;
    int (*real_open)(const char *, int, ...) = behind("open");
    ssize_t (*real_write)(int, const void *, size_t) = behind("write");
    int file = real_open(say_to, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    if (file < 0 || real_write(file, line, (size_t)length) < 0) abort();
    close(file);
}

__attribute__((constructor)) static void begin(void) {
    const char *folder = getenv("FAULT_BELOW"), *at = getenv("FAULT_AT"), *with = getenv("FAULT_ERRNO");
    if (folder && strlen(folder) < sizeof below) {
        strcpy(below, folder);
        below_length = strlen(below);
    }
    fails_at = at ? atol(at) : 0;
    fails_with = with ? atoi(with) : EIO;
    say_to = getenv("FAULT_SAY");
}

__attribute__((destructor)) static void end(void) { say("calls %ld\n", atomic_load(&calls)); }

static int is_below(const char *path) {
    return below_length > 0 && strncmp(path, below, below_length) == 0 &&
           (path[below_length] == '/' || path[below_length] == '\0');
}

/* Counts a call by the whole path it is about; returns whether it is to fail, with `errno` set. */
static int fails(const char *call, const char *path) {
    if (!is_below(path)) return 0;
    if (atomic_fetch_add(&calls, 1) + 1 != fails_at) return 0;
    say("fault %s %s\n", call, path);
    if (fails_with == 0) {
        kill(getpid(), SIGKILL);
        for (;;) pause();
    }
    errno = fails_with;
    return 1;
}

/* As `fails`, by an open file. */
static int file_fails(const char *call, int file) {
    int before = errno;
    char link[64], path[LONGEST];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    errno = before;
    if (length <= 0) return 0;
    path[length] = '\0';
    return fails(call, path);
}

/* As `fails`, by a path that may be relative, to an open folder or to the one the process is in. */
static int path_fails(const char *call, int folder, const char *path) {
    int before = errno;
    char whole[2 * LONGEST + 2], start[LONGEST] = "";
    if (path[0] != '/') {
        char link[64] = "/proc/self/cwd";
        if (folder != AT_FDCWD) snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
        ssize_t length = readlink(link, start, sizeof start - 1);
        start[length > 0 ? length : 0] = '\0';
    }
    snprintf(whole, sizeof whole, "%s%s%s", start, path[0] == '/' ? "" : "/", path);
    errno = before;
    return fails(call, whole);
}

#define REAL(name) static typeof(name) *real; if (!real) real = behind(#name)

#define OPEN(name)                                                       \
    int name(const char *path, int flags, ...) {                         \
        REAL(name);                                                      \
        va_list more; va_start(more, flags);                             \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more);                                                    \
        return path_fails("open", AT_FDCWD, path) ? -1 : real(path, flags, mode); \
    }
#define OPENAT(name)                                                     \
    int name(int folder, const char *path, int flags, ...) {             \
        REAL(name);                                                      \
        va_list more; va_start(more, flags);                             \
        mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(more, mode_t) : 0; \
        va_end(more);                                                    \
        return path_fails("open", folder, path) ? -1 : real(folder, path, flags, mode); \
    }
OPEN(open) OPEN(open64) OPENAT(openat) OPENAT(openat64)

/* Defines a function that fails by the open file or the path it is about, and else is the real one. */
#define BY_FILE(result, name, ...) BY(result, name, file_fails(#name, file), __VA_ARGS__)
#define BY(result, name, test, declared, passed)                         \
    result name declared { REAL(name); return test ? -1 : real passed; }

BY_FILE(ssize_t, write, (int file, const void *bytes, size_t length), (file, bytes, length))
BY_FILE(ssize_t, writev, (int file, const struct iovec *parts, int count), (file, parts, count))
BY_FILE(int, fsync, (int file), (file))
BY_FILE(int, fdatasync, (int file), (file))
BY_FILE(int, fchmod, (int file, mode_t mode), (file, mode))
BY_FILE(int, ftruncate64, (int file, off64_t length), (file, length))
BY_FILE(int, flock, (int file, int operation), (file, operation))
BY(int, rename, path_fails("rename", AT_FDCWD, to), (const char *from, const char *to), (from, to))
BY(int, renameat2, path_fails("rename", into, to), (int in, const char *from, int into, const char *to, unsigned flags),
   (in, from, into, to, flags))
BY(int, symlink, path_fails("symlink", AT_FDCWD, path), (const char *target, const char *path), (target, path))
BY(int, linkat, path_fails("link", into, to), (int in, const char *from, int into, const char *to, int flags),
   (in, from, into, to, flags))
BY(int, mkdir, path_fails("mkdir", AT_FDCWD, path), (const char *path, mode_t mode), (path, mode))
BY(int, rmdir, path_fails("rmdir", AT_FDCWD, path), (const char *path), (path))
BY(int, unlink, path_fails("unlink", AT_FDCWD, path), (const char *path), (path))
BY(int, unlinkat, path_fails("unlink", folder, path), (int folder, const char *path, int flags), (folder, path, flags))
BY(int, chmod, path_fails("chmod", AT_FDCWD, path), (const char *path, mode_t mode), (path, mode))
