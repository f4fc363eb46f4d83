/* An instance from fmi2Instantiate to fmi2FreeInstance. */
#include "slave.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Number of instances in this process. */
static int instances;

EXPORT const char *fmi2GetTypesPlatform(void) {
    return "default";
}

EXPORT const char *fmi2GetVersion(void) {
    return VERSION;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                                     fmi2String resources, const fmi2CallbackFunctions *functions,
                                     fmi2Boolean visible, fmi2Boolean logging) {
    Slave *slave = calloc(1, sizeof *slave);
    (void)resources, (void)visible;
    slave->functions = functions;
    snprintf(slave->name, sizeof slave->name, "%s", name);
    snprintf(slave->behaviour, sizeof slave->behaviour, "%s", guid);
    slave->now.u = 1;
    slave->t1 = 0.5;
    slave->n = 3;
    slave->now.enumeration[INPUT] = slave->now.enumeration[OUTPUT] = 1;
    if (type != fmi2CoSimulation || misbehave(slave, "fmi2Instantiate") > fmi2Warning) {
        free(slave);
        return NULL;
    }
    if (is(slave, "silent without loggingOn")) {
        if (logging) {
            say(slave, fmi2Error, "there is no licence");
        }
        free(slave);
        return NULL;
    }
    if (is(slave, "one instance only") && instances > 0) {
        say(slave, fmi2Error, "there is an instance already");
        free(slave);
        return NULL;
    }
    instances++;
    return slave;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    Slave *slave = c;
    demand(slave == NULL || slave->now.state != PENDING);
    if (slave != NULL) {
        misbehave(slave, "fmi2FreeInstance");
        instances--;
        free(slave);
    }
}

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count,
                                      const fmi2String categories[]) {
    (void)on, (void)count, (void)categories;
    return misbehave(c, "fmi2SetDebugLogging");
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance,
                                      fmi2Real tolerance, fmi2Real start, fmi2Boolean has_stop,
                                      fmi2Real stop) {
    Slave *slave = c;
    demand(slave->now.state == INSTANTIATED);
    slave->now.time = start;
    slave->stop = has_stop ? stop : INFINITY;
    if (is(slave, "start at the tolerance")) {
        slave->now.x = has_tolerance ? tolerance : -1;
    }
    return misbehave(slave, "fmi2SetupExperiment");
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Slave *slave = c;
    demand(slave->now.state == INSTANTIATED);
    slave->now.state = INITIALIZING;
    return misbehave(slave, "fmi2EnterInitializationMode");
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Slave *slave = c;
    demand(slave->now.state == INITIALIZING);
    slave->now.state = STEPPING;
    return misbehave(slave, "fmi2ExitInitializationMode");
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    Slave *slave = c;
    demand(slave->now.state == STEPPING || slave->now.state == DISCARDED);
    slave->now.state = ENDED;
    return misbehave(slave, "fmi2Terminate");
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    return refuse(c, "cannot be reset");
}

