/* Feeds measurements from standard input to a controller that `aso-ftc design --c-code` has written, and writes
 * commands, estimates and status to standard output. Each sample has the measurements, the references, the
 * scheduling variable, whether to compensate, of a detection whether to reset it, and of a reconfiguration what is known about the actuators,
 * all as doubles. Macros: NAME (of the controller), REAL (double or
 * float), REFERENCES and SCHEDULE if it has them as inputs, DETECTION and RECONFIGURATIONS if it has them, FIRST_SAMPLE for another number
 * of the first sample than 0; the header comes by -include. */
#include <stdio.h>
#include <string.h>

#define JOINED(name, part) name##_##part
#define JOIN(name, part) JOINED(name, part)
#define COUNT(signals) (sizeof(signals) / sizeof(REAL))

static JOIN(NAME, Measurements) measurements;
#ifdef REFERENCES
static JOIN(NAME, References) references;
#define REFERENCE_COUNT COUNT(references)
#define REFERENCE_ARGUMENT &references,
#else
#define REFERENCE_COUNT 0
#define REFERENCE_ARGUMENT
#endif
#ifdef SCHEDULE
static JOIN(NAME, Schedule) schedule;
#define SCHEDULE_ARGUMENT &schedule,
#define ALL (COUNT(measurements) + REFERENCE_COUNT + 1)
#else
#define SCHEDULE_ARGUMENT
#define ALL (COUNT(measurements) + REFERENCE_COUNT)
#endif
#ifdef DETECTION
static JOIN(NAME, Detection) detection;
#define FLAGS 2
#define RESET_ARGUMENT , values[ALL + 1] > 0.5
#define DETECTION_ARGUMENT , &detection
#else
#define FLAGS 1
#define RESET_ARGUMENT
#define DETECTION_ARGUMENT
#endif
#ifdef RECONFIGURATIONS
static JOIN(NAME, Actuators) actuators;
static int32_t reconfiguration;
#define SWITCHES sizeof(actuators)
#define ACTUATORS_ARGUMENT &actuators,
#define RECONFIGURATION_ARGUMENT , &reconfiguration
#else
#define SWITCHES 0
#define ACTUATORS_ARGUMENT
#define RECONFIGURATION_ARGUMENT
#endif
static JOIN(NAME, Commands) commands;
static JOIN(NAME, Estimates) estimates;

static void put(const void *signals, size_t count)
{
    const unsigned char *bytes = signals;
    for (size_t k = 0; k < count; k++)
    {
        REAL value;
        memcpy(&value, bytes + k * sizeof(REAL), sizeof(REAL));
        double wide = (double)value;
        fwrite(&wide, sizeof(wide), 1, stdout);
    }
}

int main(void)
{
    JOIN(NAME, State) state;
    double values[ALL + FLAGS + SWITCHES];
    /* The start sets every field that is read: no flag may keep these bytes. */
    memset(&state, 0xa5, sizeof(state));
    JOIN(NAME, init)(&state);
#ifdef FIRST_SAMPLE
    state.sample = FIRST_SAMPLE;
#endif
    fprintf(stderr, "%zu\n", sizeof(state));
    while (fread(values, sizeof(values), 1, stdin) == 1)
    {
        REAL received[ALL];
        for (size_t k = 0; k < ALL; k++)
        {
            received[k] = (REAL)values[k];
        }
        memcpy(&measurements, received, sizeof(measurements));
#ifdef REFERENCES
        memcpy(&references, received + COUNT(measurements), sizeof(references));
#endif
#ifdef SCHEDULE
        memcpy(&schedule, received + ALL - 1, sizeof(schedule));
#endif
#ifdef RECONFIGURATIONS
        for (size_t k = 0; k < SWITCHES; k++)
        {
            ((bool *)&actuators)[k] = values[ALL + FLAGS + k] > 0.5;
        }
#endif
        uint32_t bits = JOIN(NAME, step)(&state, &measurements, REFERENCE_ARGUMENT SCHEDULE_ARGUMENT ACTUATORS_ARGUMENT
                                         values[ALL] > 0.5 RESET_ARGUMENT,
                                         &commands, &estimates DETECTION_ARGUMENT RECONFIGURATION_ARGUMENT);
        put(&commands, COUNT(commands));
        put(&estimates, COUNT(estimates));
#ifdef DETECTION
        double decision[] = {detection.detected, detection.isolated, (double)detection.t_detected, (double)detection.t_onset};
        fwrite(decision, sizeof(decision), 1, stdout);
        put(detection.residual, COUNT(detection.residual));
        put(detection.statistic, COUNT(detection.statistic));
#endif
#ifdef RECONFIGURATIONS
        double number = (double)reconfiguration;
        fwrite(&number, sizeof(number), 1, stdout);
#endif
        double status = (double)bits;
        fwrite(&status, sizeof(status), 1, stdout);
    }
    return 0;
}
