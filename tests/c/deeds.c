/* The misbehaviours of a slave, on request. */
#define _GNU_SOURCE
#include "slave.h"

#include <fenv.h>
#include <locale.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

enum { FLOOD = 1000000, LONG = 1000000, LEAK = 1 << 16 };

#ifdef MISSING
/* No library defines it. */
extern void MISSING(void);
#endif

/* Whether some instance returned fmi2Fatal: then no function of any instance may be called (section 2.1.3). */
static int corrupted;

int is(const Slave *slave, const char *behaviour) {
    return strcmp(slave->behaviour, behaviour) == 0;
}

void say(const Slave *slave, fmi2Status status, const char *text) {
    static const char *const categories[] = {
        "logAll", "logStatusWarning", "logStatusDiscard",
        "logStatusError", "logStatusFatal", "logStatusPending",
    };
    const char *category = status <= fmi2Pending ? categories[status] : NULL;
    void *environment = slave->functions->componentEnvironment;
    slave->functions->logger(environment, slave->name, status, category, "%s", text);
}

static void talk(const Slave *slave, const char *deed) {
    const fmi2CallbackFunctions *f = slave->functions;
    if (strcmp(deed, "flood") == 0) {
        for (int k = 0; k < FLOOD; k++) {
            f->logger(f->componentEnvironment, slave->name, fmi2OK, "logAll", "message %d", k);
        }
    } else if (strcmp(deed, "long message") == 0) {
        char *text = malloc(LONG + 1);
        memset(text, 'm', LONG);
        text[LONG] = '\0';
        say(slave, fmi2Warning, text);
        free(text);
    } else if (strcmp(deed, "no category") == 0) {
        f->logger(f->componentEnvironment, slave->name, fmi2Warning, NULL, "uncategorised");
    } else if (strcmp(deed, "no message") == 0) {
        f->logger(f->componentEnvironment, slave->name, fmi2Warning, "logAll", NULL);
    } else if (strcmp(deed, "no name") == 0) {
        f->logger(f->componentEnvironment, NULL, fmi2Warning, "logAll", "anonymous");
    } else if (strcmp(deed, "specifiers") == 0) {
        f->logger(f->componentEnvironment, "%s%n", fmi2Warning, "%s%n", "%d%% of %s at %.3f %s", 7,
                  "%s%n", 0.125, "\xff\xfe");
    } else if (strcmp(deed, "no environment") == 0) {
        f->logger(NULL, slave->name, fmi2Warning, "logAll", "message %d of %s", 1, "nobody");
    } else if (strcmp(deed, "another environment") == 0) {
        /* Nothing here can be looked into but the message. */
        f->logger((void *)8, (const char *)16, fmi2Warning, (const char *)24, "message %d", 2);
        f->logger((void *)slave, slave->name, fmi2Warning, "logAll", "message %d", 3);
    } else if (strcmp(deed, "names") == 0) {
        f->logger(f->componentEnvironment, slave->name, fmi2Warning, "logAll",
                  "#r0#, #b1# and #r77# are ##%d", 4);
    } else if (strcmp(deed, "print") == 0) {
        printf("printed by an FMU\n");
        fflush(stdout);
    }
}

/* Recurses without end. */
static int fill_stack(int depth) {
    volatile char frame[4096];
    static volatile int for_ever = 1;
    memset((void *)frame, depth, sizeof frame);
    return for_ever ? fill_stack(depth + 1) + frame[0] : 0;
}

/* Misbehaviours that affect the process of the FMU. */
static void meddle(const char *deed) {
    if (strcmp(deed, "crash") == 0) {
        volatile int *volatile nowhere = NULL;
        *nowhere = 0;
    } else if (strcmp(deed, "abort") == 0) {
        abort();
    } else if (strcmp(deed, "exit 3") == 0) {
        exit(3);
    } else if (strcmp(deed, "exit 0") == 0) {
        exit(0);
    } else if (strcmp(deed, "overflow the stack") == 0) {
        fill_stack(1);
    } else if (strcmp(deed, "divide by zero") == 0) {
        volatile int zero = 0;
        zero = 7 / zero;
    } else if (strcmp(deed, "fork") == 0) {
        /* Children that end as processes do are no end of this one. */
        int exited = 0, killed = 0;
        pid_t first = fork();
        if (first == 0) {
            exit(5);
        }
        pid_t second = fork();
        if (second == 0) {
            abort();
        }
        waitpid(first, &exited, 0);
        waitpid(second, &killed, 0);
        if (!WIFEXITED(exited) || WEXITSTATUS(exited) != 5 || !WIFSIGNALED(killed)) {
            abort();
        }
    } else if (strcmp(deed, "hang") == 0) {
        /* A test may wait for this file. */
        const char *name = getenv("HANGS");
        FILE *file = name != NULL ? fopen(name, "w") : NULL;
        if (file != NULL) {
            fclose(file);
        }
        for (;;) {
            usleep(1000);
        }
    } else if (strcmp(deed, "spin") == 0) {
        for (volatile int forever = 1; forever;) {
        }
    } else if (strcmp(deed, "corrupt the heap") == 0) {
        char *volatile small = malloc(24);
        memset(small, 0xff, 4096);
        for (size_t size = 16; size < 4096; size += 16) {
            char *volatile other = malloc(size);
            free(other);
        }
        abort();
    } else if (strcmp(deed, "round up") == 0) {
        fesetround(FE_UPWARD);
    } else if (strcmp(deed, "change the locale") == 0) {
        /* Where there is no German locale the name of the folder for C messages changes at least. */
        if (setlocale(LC_ALL, "de_DE.UTF-8") == NULL) {
            setlocale(LC_ALL, "C.UTF-8");
        }
    } else if (strcmp(deed, "change the folder") == 0) {
        if (chdir("/") != 0) {
            abort();
        }
    } else if (strcmp(deed, "change the environment") == 0) {
        setenv("SLAVE_WAS_HERE", "1", 1);
    } else if (strcmp(deed, "join the group of the parent") == 0) {
        setpgid(0, getpgid(getppid()));
    } else if (strcmp(deed, "call a missing function") == 0) {
#ifdef MISSING
        MISSING();
#endif
    } else if (strcmp(deed, "leak") == 0) {
        char *volatile lost = malloc(LEAK);
        memset(lost, 1, LEAK);
    }
}

#ifdef ON_LOAD
__attribute__((constructor)) static void load(void) {
    meddle(ON_LOAD);
}
#endif

#ifdef ON_UNLOAD
__attribute__((destructor)) static void unload(void) {
    meddle(ON_UNLOAD);
}
#endif

#ifdef AT_EXIT
static void end(void) {
    meddle(AT_EXIT);
}

__attribute__((constructor)) static void register_end(void) {
    atexit(end);
}
#endif

fmi2Status misbehave(Slave *slave, const char *function) {
    static const char *const statuses[] = { "warn", "discard", "fail", "fail fatally", "stay pending" };
    const char *in = strstr(slave->behaviour, " in ");
    char deed[sizeof slave->behaviour] = "";
    if (in == NULL || strcmp(in + 4, function) != 0) {
        return is(slave, "warn everywhere") ? fmi2Warning : fmi2OK;
    }
    memcpy(deed, slave->behaviour, (size_t)(in - slave->behaviour));
    talk(slave, deed);
    meddle(deed);
    meddle_with_process(deed);
    meddle_with_files(deed);
    if (strcmp(deed, "forget") == 0) {
        slave->t1 = 0.5;
        slave->n = 3;
    }
    for (int k = 0; k < 5; k++) {
        if (strcmp(deed, statuses[k]) == 0) {
            say(slave, fmi2Warning + k, "as it was told");
            slave->now.state = k >= 2 ? FAILED : slave->now.state;
            corrupted |= k == 3;
            return fmi2Warning + k;
        }
    }
    if (strcmp(deed, "fail silently") == 0) {
        return fmi2Error;
    }
    return strcmp(deed, "return 17") == 0 ? (fmi2Status)17 : fmi2OK;
}

int due(const Slave *slave) {
    return slave->now.time >= slave->t1 - 1e-9;
}

void demand(int allowed) {
    if (!allowed || corrupted) {
        abort();
    }
}

fmi2Status refuse(Slave *slave, const char *text) {
    say(slave, fmi2Error, text);
    slave->now.state = FAILED;
    return fmi2Error;
}
