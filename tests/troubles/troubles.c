/* An FMU for co-simulation that integrates y' = u by Euler's method, until its Integer `trouble`
 * selects one of the misbehaviours below. It has a long state and lacks directional derivatives. */
#define _GNU_SOURCE
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef void (*logger)(void *, const char *, int, const char *, const char *, ...);
struct callbacks {
    logger log;
    void *allocate, *release, *finished;
    void *environment;
};
enum { OK, WARNING, DISCARD, ERROR };
enum trouble {
    NONE,
    CRASH_IN_STEP,
    ABORT,
    LEAVE,
    HANG,
    FLOOD,
    BREAK_HEAP,
    CRASH_IN_GET,
    PRINT,
    OVERWRITE_SHARED,
    DIVIDE_BY_ZERO,
    CLOSE_FILES,
    REFUSE,
    HANG_IN_FREE,
    CRASH_IN_FREE,
    OVERFLOW_STACK,
    STOP_EARLY,
    HANG_WITH_CHILD,
    ANSWER_WRONG_TURN,
    LEAVE_WITH_CHILD,
    TAKE_MEMORY,
    PRINT_FLOOD,
};
struct values {
    double u, y, reached;
    int trouble, flag;
    char bulk[1 << 20];
};
struct instance {
    struct values values;
    const struct callbacks *callbacks;
    char *text;
};

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

static void say(struct instance *i, int status, const char *text) {
    i->callbacks->log(i->callbacks->environment, "instance", status, "logAll", "%s", text);
}

void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                      const struct callbacks *callbacks, int visible, int logging) {
    struct instance *i = calloc(1, sizeof *i);
    (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
    i->callbacks = callbacks;
    i->text = strdup("");
    if (strcmp(name, "crashes at once") == 0) {
        say(i, WARNING, "going down");
        *(volatile int *)0 = 1;
    }
    if (strcmp(name, "refuses") == 0) {
        say(i, ERROR, "not under this name");
        return NULL;
    }
    return i;
}

static void be_silent_for_ever(void) {
    for (;;) {
        pause();
    }
}

void fmi2FreeInstance(void *c) {
    struct instance *i = c;
    if (i->values.trouble == HANG_IN_FREE) {
        be_silent_for_ever();
    }
    if (i->values.trouble == CRASH_IN_FREE) {
        abort();
    }
    free(i->text);
    free(i);
}

int fmi2SetDebugLogging(void *c, int on, size_t count, const char *const categories[]) {
    (void)count, (void)categories;
    say(c, OK, on ? "logging on" : "logging off");
    return OK;
}
int fmi2SetupExperiment(void *c, int has_tolerance, double tolerance, double start, int has_stop,
                        double stop) {
    char text[200];
    snprintf(text, sizeof text, "%d %g %g %d %g", has_tolerance, tolerance, start, has_stop, stop);
    say(c, OK, text);
    return OK;
}
int fmi2EnterInitializationMode(void *c) { return (void)c, OK; }
int fmi2ExitInitializationMode(void *c) { return (void)c, OK; }
int fmi2Terminate(void *c) { return (void)c, OK; }

int fmi2SetReal(void *c, const unsigned *r, size_t count, const double *v) {
    struct instance *i = c;
    for (size_t k = 0; k < count; k++) {
        if (r[k] != 0) {
            return ERROR;
        }
        i->values.u = v[k];
    }
    return OK;
}
int fmi2GetReal(void *c, const unsigned *r, size_t count, double *v) {
    struct instance *i = c;
    if (i->values.trouble == CRASH_IN_GET) {
        *(volatile int *)0 = 1;
    }
    for (size_t k = 0; k < count; k++) {
        v[k] = r[k] == 0 ? i->values.u : i->values.y;
    }
    return OK;
}
int fmi2SetInteger(void *c, const unsigned *r, size_t count, const int *v) {
    (void)r;
    if (count > 0) {
        ((struct instance *)c)->values.trouble = v[count - 1];
    }
    return OK;
}
int fmi2GetInteger(void *c, const unsigned *r, size_t count, int *v) {
    (void)r;
    for (size_t k = 0; k < count; k++) {
        v[k] = ((struct instance *)c)->values.trouble;
    }
    return OK;
}
int fmi2SetBoolean(void *c, const unsigned *r, size_t count, const int *v) {
    (void)r;
    if (count > 0) {
        ((struct instance *)c)->values.flag = v[count - 1];
    }
    return OK;
}
int fmi2GetBoolean(void *c, const unsigned *r, size_t count, int *v) {
    (void)r;
    for (size_t k = 0; k < count; k++) {
        v[k] = ((struct instance *)c)->values.flag;
    }
    return OK;
}
int fmi2SetString(void *c, const unsigned *r, size_t count, const char *const *v) {
    struct instance *i = c;
    (void)r;
    for (size_t k = 0; k < count; k++) {
        free(i->text);
        i->text = strdup(v[k]);
    }
    return OK;
}
int fmi2GetString(void *c, const unsigned *r, size_t count, const char **v) {
    (void)r;
    for (size_t k = 0; k < count; k++) {
        v[k] = ((struct instance *)c)->text;
    }
    return OK;
}

/* Finds the shared memory of the worker. */
static uint64_t *find_shared(size_t *count) {
    FILE *maps = fopen("/proc/self/maps", "r");
    char line[512];
    uint64_t *found = NULL;
    while (maps != NULL && fgets(line, sizeof line, maps) != NULL) {
        unsigned long begin, end;
        if (strstr(line, "/memfd:fmu") && sscanf(line, "%lx-%lx", &begin, &end) == 2) {
            found = (uint64_t *)begin;
            *count = (end - begin) / sizeof *found;
        }
    }
    if (maps != NULL) {
        fclose(maps);
    }
    return found;
}

/* Overwrites it with numbers of all magnitudes, for ever. */
static void *overwrite_shared(void *unused) {
    size_t count = 0;
    volatile uint64_t *words = find_shared(&count);
    uint64_t random = 1;
    (void)unused;
    for (size_t k = 0; count > 0; k = (k + 1) % count) {
        random = random * 6364136223846793005u + 1;
        words[k] = random >> (random >> 58);
    }
    return NULL;
}

static int overflow_stack(int depth) {
    volatile char frame[4096];
    static volatile int for_ever = 1;
    if (!for_ever) {
        return 0;
    }
    memset((void *)frame, depth, sizeof frame);
    return overflow_stack(depth + 1) + frame[depth % 4096];
}

static void break_heap(void) {
    char *volatile block = malloc(24);
    volatile char *beyond = block;
    for (int k = 0; k < 64; k++) {
        beyond[k] = 'A';
    }
    free(block);
    free(block);
}

static int in_step(struct instance *i, double time, double size) {
    volatile int zero = 0;
    pthread_t thread;
    size_t count;
    switch (i->values.trouble) {
    case CRASH_IN_STEP:
        say(i, WARNING, "this will not end well");
        *(volatile int *)0 = 1;
        break;
    case ABORT: abort();
    case LEAVE: exit(3);
    case HANG: be_silent_for_ever(); break;
    case HANG_WITH_CHILD:
        if (fork() == 0) {
            execlp("sleep", "sleep", "1000", (char *)NULL);
        }
        be_silent_for_ever();
        break;
    case LEAVE_WITH_CHILD:
        if (fork() == 0) {
            execlp("sleep", "sleep", "1000", (char *)NULL);
        }
        _exit(3);
    case TAKE_MEMORY:
        for (;;) {
            memset(malloc(1 << 24), 1, 1 << 24);
        }
    case PRINT_FLOOD:
        for (int k = 0; k < 1 << 20; k++) {
            printf("again and again and again, line %d\n", k);
        }
        fflush(stdout);
        break;
    case FLOOD:
        for (int k = 0; k < 1000000; k++) {
            say(i, WARNING, "again and again and again");
        }
        break;
    case BREAK_HEAP: break_heap(); break;
    case PRINT:
        printf("noise on standard output\n");
        fflush(stdout);
        break;
    case OVERWRITE_SHARED: pthread_create(&thread, NULL, overwrite_shared, NULL); break;
    case ANSWER_WRONG_TURN:
        *find_shared(&count) = 77;
        be_silent_for_ever();
        break;
    case DIVIDE_BY_ZERO: zero = 7 / zero; break;
    case CLOSE_FILES:
        for (int file = 3; file < 1024; file++) {
            close(file);
        }
        be_silent_for_ever();
        break;
    case REFUSE: say(i, ERROR, "not today"); return ERROR;
    case OVERFLOW_STACK: return overflow_stack(0);
    case STOP_EARLY:
        i->values.reached = time + size / 4;
        i->values.y += size / 4 * i->values.u;
        return DISCARD;
    default: break;
    }
    return OK;
}

int fmi2DoStep(void *c, double time, double size, int never_back) {
    struct instance *i = c;
    int status = in_step(i, time, size);
    (void)never_back;
    if (status != OK) {
        return status;
    }
    i->values.y += size * i->values.u;
    i->values.bulk[((int)(time / size)) % sizeof i->values.bulk] = (char)(1 + (int)(time / size) % 100);
    return OK;
}
int fmi2GetRealStatus(void *c, int kind, double *value) {
    (void)kind;
    *value = ((struct instance *)c)->values.reached;
    return OK;
}
int fmi2GetBooleanStatus(void *c, int kind, int *value) {
    (void)c, (void)kind;
    *value = 1;
    return OK;
}

int fmi2GetFMUstate(void *c, void **state) {
    if (*state == NULL) {
        *state = malloc(sizeof(struct values));
    }
    memcpy(*state, &((struct instance *)c)->values, sizeof(struct values));
    return OK;
}
int fmi2SetFMUstate(void *c, void *state) {
    memcpy(&((struct instance *)c)->values, state, sizeof(struct values));
    return OK;
}
int fmi2FreeFMUstate(void *c, void **state) {
    (void)c;
    free(*state);
    *state = NULL;
    return OK;
}
int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(struct values);
    return OK;
}
int fmi2SerializeFMUstate(void *c, void *state, char *bytes, size_t size) {
    (void)c;
    memcpy(bytes, state, size);
    return OK;
}
int fmi2DeSerializeFMUstate(void *c, const char *bytes, size_t size, void **state) {
    (void)c;
    if (size != sizeof(struct values)) {
        return ERROR;
    }
    *state = malloc(size);
    memcpy(*state, bytes, size);
    return OK;
}
