/* Misbehaviours by which a slave ends its process, or leaves something in it that does. */
#define _GNU_SOURCE
#include "slave.h"

#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <unwind.h>

static void leave_with_7(void) {
    _exit(7);
}

static void crash(void) {
    volatile int *volatile nowhere = NULL;
    *nowhere = 0;
}

static void hang(void) {
    for (;;) {
        pause();
    }
}

/* Functions of the C library that the program calls when it exits. */
static void at_exit(void (*function)(void)) {
    on_exit((void (*)(int, void *))function, NULL);
}

void meddle_with_process(const char *deed) {
    static struct _Unwind_Exception thrown;
    if (strcmp(deed, "leave 0") == 0) {
        _exit(0);
    } else if (strcmp(deed, "become another program") == 0) {
        execl("/bin/true", "true", (char *)NULL);
    } else if (strcmp(deed, "throw") == 0) {
        _Unwind_RaiseException(&thrown);
        abort();
    } else if (strcmp(deed, "end the thread") == 0) {
        pthread_exit(NULL);
    } else if (strcmp(deed, "fork and go on") == 0) {
        (void)!fork();
    } else if (strcmp(deed, "forget SIGSEGV and crash") == 0) {
        signal(SIGSEGV, SIG_DFL);
        crash();
    } else if (strcmp(deed, "kill itself") == 0) {
        kill(getpid(), SIGKILL);
    } else if (strcmp(deed, "leave 7 when unloaded") == 0) {
        atexit(leave_with_7);
    } else if (strcmp(deed, "crash when unloaded") == 0) {
        atexit(crash);
    } else if (strcmp(deed, "hang when unloaded") == 0) {
        atexit(hang);
    } else if (strcmp(deed, "abort at exit") == 0) {
        at_exit(abort);
    } else if (strcmp(deed, "hang at exit") == 0) {
        at_exit((void (*)(void))pause);
    }
}
