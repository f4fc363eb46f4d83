/* The types of FMI 3.0.2, sections 2.2 and 4.2, that a co-simulation slave needs. */
#ifndef FMI3_H
#define FMI3_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef void *fmi3Instance;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
    fmi3IntervalNotYetKnown,
    fmi3IntervalUnchanged,
    fmi3IntervalChanged
} fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(void *environment, fmi3Status status, fmi3String category,
                                       fmi3String message);
typedef void (*fmi3IntermediateUpdateCallback)(void *environment, double time, bool set_requested,
                                               bool get_allowed, bool finished,
                                               bool can_return_early, bool *return_requested,
                                               double *return_time);
typedef void (*fmi3ClockUpdateCallback)(void *environment);
typedef void (*fmi3PreemptionCallback)(void);

#endif
