/* A co-simulation slave with any number of Real variables, or Integers that are their whole parts. They keep what they
 * are set to: the value of the reference 2 k + 1 is that of the reference 2 k after a step. The GUID is the number of
 * variables. */
#include "fmi2.h"

#include <stdlib.h>

#define EXPORT __attribute__((visibility("default")))

typedef struct {
    size_t count;
    double *values;
} Slave;

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                     fmi2Boolean logging) {
    (void)name, (void)type, (void)resources, (void)functions, (void)visible, (void)logging;
    Slave *slave = malloc(sizeof *slave);
    slave->count = strtoul(guid, NULL, 10);
    slave->values = calloc(slave->count, sizeof *slave->values);
    return slave;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    Slave *slave = c;
    free(slave->values);
    free(slave);
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean limited, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean stops, fmi2Real stop) {
    (void)c, (void)limited, (void)tolerance, (void)start, (void)stops, (void)stop;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return (void)c, fmi2OK; }
EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return (void)c, fmi2OK; }
EXPORT fmi2Status fmi2Terminate(fmi2Component c) { return (void)c, fmi2OK; }
EXPORT fmi2Status fmi2Reset(fmi2Component c) { return (void)c, fmi2OK; }

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                              fmi2Real values[]) {
    const Slave *slave = c;
    for (size_t k = 0; k < count; k++) {
        if (references[k] >= slave->count) {
            return fmi2Error;
        }
        values[k] = slave->values[references[k]];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count,
                              const fmi2Real values[]) {
    Slave *slave = c;
    for (size_t k = 0; k < count; k++) {
        if (references[k] >= slave->count) {
            return fmi2Error;
        }
        slave->values[references[k]] = values[k];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                 fmi2Integer values[]) {
    for (size_t k = 0; k < count; k++) {
        double value;
        if (fmi2GetReal(c, &references[k], 1, &value) != fmi2OK) {
            return fmi2Error;
        }
        values[k] = (fmi2Integer)value;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                 const fmi2Integer values[]) {
    for (size_t k = 0; k < count; k++) {
        double value = values[k];
        if (fmi2SetReal(c, &references[k], 1, &value) != fmi2OK) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean never_back) {
    Slave *slave = c;
    (void)time, (void)step, (void)never_back;
    for (size_t k = 1; k < slave->count; k += 2) {
        slave->values[k] = slave->values[k - 1];
    }
    return fmi2OK;
}
