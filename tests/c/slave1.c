/* A co-simulation slave of FMI 1.0 (stand-alone).
 *
 * der(y) = u, held over a step; integer, Boolean and String go from input to output with a step. The
 * parameter `gain` is the factor of u. The GUID selects a misbehaviour: "discard" discards the part of
 * a step beyond 0.25 s once, "pending" returns fmiPending from every step and is done when it is asked
 * for the second time, "refuse" refuses to instantiate with a message.
 *
 * It is strict: a call that the standard forbids ends the process by SIGABRT. */
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define EXPORT __attribute__((visibility("default")))

typedef void *fmiComponent;
typedef unsigned fmiValueReference;
typedef char fmiBoolean;
typedef const char *fmiString;
typedef enum { fmiOK, fmiWarning, fmiDiscard, fmiError, fmiFatal, fmiPending } fmiStatus;
typedef struct {
    void (*logger)(fmiComponent c, fmiString instance, fmiStatus status, fmiString category,
                   fmiString message, ...);
    void *(*allocate_memory)(size_t count, size_t size);
    void (*free_memory)(void *memory);
    void (*step_finished)(fmiComponent c, fmiStatus status);
} fmiCallbackFunctions;

typedef struct {
    fmiCallbackFunctions functions;
    int initialised, left, discarded;
    double time, u, y, gain;
    int integer[2];
    fmiBoolean boolean[2];
    char text[2][100], guid[40];
} Slave;

static void demand(int allowed, const char *what) {
    if (!allowed) {
        fprintf(stderr, "slave1: %s\n", what);
        abort();
    }
}

EXPORT fmiString slave1_fmiGetVersion(void) { return "1.0"; }
EXPORT fmiString slave1_fmiGetTypesPlatform(void) { return "standard32"; }

EXPORT fmiComponent slave1_fmiInstantiateSlave(fmiString name, fmiString guid, fmiString location,
                                               fmiString mime_type, double timeout,
                                               fmiBoolean visible, fmiBoolean interactive,
                                               fmiCallbackFunctions functions, fmiBoolean logging) {
    demand(strcmp(mime_type, "application/x-fmu-sharedlibrary") == 0, "mimeType");
    demand(strncmp(location, "file:///", 8) == 0, "fmuLocation");
    demand(timeout >= 0 && !visible && !interactive && !logging, "fmiInstantiateSlave");
    if (strcmp(guid, "refuse") == 0) {
        functions.logger(NULL, name, fmiError, "error", "%s has no licence for %d days", name, 3);
        return NULL;
    }
    Slave *slave = functions.allocate_memory(1, sizeof *slave);
    slave->functions = functions;
    slave->u = slave->gain = 1;
    strncpy(slave->guid, guid, sizeof slave->guid - 1);
    return slave;
}

EXPORT void slave1_fmiFreeSlaveInstance(fmiComponent c) {
    Slave *slave = c;
    slave->functions.free_memory(slave);
}

EXPORT fmiStatus slave1_fmiSetDebugLogging(fmiComponent c, fmiBoolean on) {
    (void)c, (void)on;
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiInitializeSlave(fmiComponent c, double start, fmiBoolean has_stop,
                                           double stop) {
    Slave *slave = c;
    (void)has_stop, (void)stop;
    demand(!slave->initialised, "fmiInitializeSlave");
    slave->initialised = 1;
    slave->time = start;
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiTerminateSlave(fmiComponent c) {
    demand(((Slave *)c)->initialised, "fmiTerminateSlave");
    return fmiOK;
}

static fmiStatus advance(Slave *slave, double end) {
    slave->y += (end - slave->time) * slave->gain * slave->u;
    slave->time = end;
    slave->integer[1] = slave->integer[0];
    slave->boolean[1] = slave->boolean[0];
    strcpy(slave->text[1], slave->text[0]);
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiDoStep(fmiComponent c, double time, double size, fmiBoolean new_step) {
    Slave *slave = c;
    demand(slave->initialised && new_step && fabs(time - slave->time) < 1e-9, "fmiDoStep");
    if (strcmp(slave->guid, "discard") == 0 && !slave->discarded && time + size > 0.25) {
        slave->discarded = 1;
        advance(slave, 0.25);
        return fmiDiscard;
    }
    advance(slave, time + size);
    if (strcmp(slave->guid, "pending") == 0) {
        slave->left = 2;
        return fmiPending;
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiGetStatus(fmiComponent c, int kind, fmiStatus *value) {
    Slave *slave = c;
    demand(kind == 0, "fmiDoStepStatus");
    *value = --slave->left > 0 ? fmiPending : fmiOK;
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiGetRealStatus(fmiComponent c, int kind, double *value) {
    demand(kind == 2, "fmiLastSuccessfulTime");
    *value = ((Slave *)c)->time;
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiGetReal(fmiComponent c, const fmiValueReference *vr, size_t n,
                                   double *values) {
    Slave *slave = c;
    for (size_t k = 0; k < n; k++) {
        values[k] = vr[k] == 0 ? slave->u : vr[k] == 1 ? slave->y : slave->gain;
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiSetReal(fmiComponent c, const fmiValueReference *vr, size_t n,
                                   const double *values) {
    Slave *slave = c;
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] == 0 || (vr[k] == 2 && !slave->initialised), "fmiSetReal");
        *(vr[k] == 0 ? &slave->u : &slave->gain) = values[k];
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiGetInteger(fmiComponent c, const fmiValueReference *vr, size_t n,
                                      int *values) {
    for (size_t k = 0; k < n; k++) {
        values[k] = ((Slave *)c)->integer[vr[k]];
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiSetInteger(fmiComponent c, const fmiValueReference *vr, size_t n,
                                      const int *values) {
    for (size_t k = 0; k < n; k++) {
        ((Slave *)c)->integer[vr[k]] = values[k];
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiGetBoolean(fmiComponent c, const fmiValueReference *vr, size_t n,
                                      fmiBoolean *values) {
    for (size_t k = 0; k < n; k++) {
        values[k] = ((Slave *)c)->boolean[vr[k]];
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiSetBoolean(fmiComponent c, const fmiValueReference *vr, size_t n,
                                      const fmiBoolean *values) {
    for (size_t k = 0; k < n; k++) {
        ((Slave *)c)->boolean[vr[k]] = values[k];
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiGetString(fmiComponent c, const fmiValueReference *vr, size_t n,
                                     fmiString *values) {
    for (size_t k = 0; k < n; k++) {
        values[k] = ((Slave *)c)->text[vr[k]];
    }
    return fmiOK;
}

EXPORT fmiStatus slave1_fmiSetString(fmiComponent c, const fmiValueReference *vr, size_t n,
                                     const fmiString *values) {
    for (size_t k = 0; k < n; k++) {
        snprintf(((Slave *)c)->text[vr[k]], 100, "%s", values[k]);
    }
    return fmiOK;
}
