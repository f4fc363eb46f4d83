/* A CAN bus with two nodes: an FMU of FMI 3.0.2 for co-simulation with the terminals of FMI-LS-BUS 1.0.
 *
 * A frame takes (44 + 8 n) / 100000 s for n bytes. Of the frames that wait, the one with the least identifier is next,
 * so of two nodes that start at once one loses the arbitration. At the end of a frame the countdown clocks of both
 * nodes tick: the sender gets a confirmation, the other node the frame.
 *
 * It is strict: a call that is not allowed in its mode (sections 2.2.6 and 4.2) ends the process by SIGABRT. */
#define NAME "bus3"
#include "strict3.h"

#include <math.h>
#include <string.h>

/* Value references: for each node, the number of the node times 10 plus one of these. */
enum { TX_CLOCK = 1, TX_DATA, RX_CLOCK, RX_DATA };
enum { NODES = 2, FRAME = 32, WAITING = 16, HEAD = 16 };
static const double bit_rate = 1e5;

typedef struct {
    uint8_t waiting[WAITING][FRAME];
    int count;
    uint8_t tx[FRAME];
    size_t tx_size;
    bool tx_clock, rx_clock, changed;
} Node;

typedef struct {
    Mode mode;
    double time, end;
    int sender;
    Node nodes[NODES];
} Bus;

static Node *node(Bus *bus, fmi3ValueReference vr) {
    demand(vr / 10 < NODES, "a value reference of no node");
    return &bus->nodes[vr / 10];
}

COMMON_FUNCTIONS(Bus)

static Bus *create(void) {
    Bus *bus = calloc(1, sizeof(Bus));
    bus->sender = -1;
    return bus;
}

INSTANTIATE_CO_SIMULATION(create)

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c) {
    ((Bus *)c)->mode = EVENT;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterEventMode(fmi3Instance c) {
    Bus *bus = c;
    demand(bus->mode == STEP, "fmi3EnterEventMode");
    bus->mode = EVENT;
    return fmi3OK;
}

static uint32_t identifier(const uint8_t *frame) {
    return frame[8] | (uint32_t)frame[9] << 8 | (uint32_t)frame[10] << 16 | (uint32_t)frame[11] << 24;
}

/* Starts the next frame, if the bus is free. */
static void start(Bus *bus) {
    for (int k = 0; k < NODES && bus->end <= bus->time; k++) {
        const Node *own = &bus->nodes[k];
        bool wins = bus->sender < 0 ||
                    identifier(own->waiting[0]) < identifier(bus->nodes[bus->sender].waiting[0]);
        if (own->count > 0 && wins) {
            bus->sender = k;
        }
    }
    if (bus->sender >= 0 && bus->end <= bus->time) {
        bus->end = bus->time + (44 + 8 * bus->nodes[bus->sender].waiting[0][14]) / bit_rate;
        for (int k = 0; k < NODES; k++) {
            bus->nodes[k].changed = true;
        }
    }
}

/* What the nodes get at the end of a frame. */
static void finish(Bus *bus) {
    Node *sender = &bus->nodes[bus->sender];
    for (int k = 0; k < NODES; k++) {
        Node *own = &bus->nodes[k];
        const uint8_t confirmation[12] = {0x20, [4] = 12, [8] = (uint8_t)identifier(sender->waiting[0])};
        own->tx_size = k == bus->sender ? sizeof confirmation : sender->waiting[0][4];
        memcpy(own->tx, k == bus->sender ? confirmation : sender->waiting[0], own->tx_size);
    }
    sender->count--;
    memmove(sender->waiting[0], sender->waiting[1], (WAITING - 1) * FRAME);
    bus->sender = -1;
}

EXPORT fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, bool *need_update, bool *terminate, bool *nominals,
                                           bool *values, bool *defined, double *next) {
    Bus *bus = c;
    demand(bus->mode == EVENT, "fmi3UpdateDiscreteStates");
    demand(bus->nodes[0].tx_clock == bus->nodes[1].tx_clock, "clocks of equal intervals that tick apart");
    for (int k = 0; k < NODES; k++) {
        bus->nodes[k].tx_clock = bus->nodes[k].rx_clock = false;
    }
    start(bus);
    *need_update = *terminate = *nominals = *values = *defined = false;
    *next = 0;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterStepMode(fmi3Instance c) {
    Bus *bus = c;
    demand(bus->mode == EVENT, "fmi3EnterStepMode");
    bus->mode = STEP;
    return fmi3OK;
}

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, double time, double size, bool never_back, bool *event,
                             bool *terminate, bool *early, double *reached) {
    Bus *bus = c;
    (void)never_back;
    demand(bus->mode == STEP, "fmi3DoStep");
    demand(bus->sender < 0 || time + size <= bus->end + 1e-9, "a step across a tick");
    bus->time = *reached = time + size;
    *event = *terminate = *early = false;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetClock(fmi3Instance c, const fmi3ValueReference *vr, size_t n, bool *values) {
    (void)c, (void)vr, (void)n, (void)values;
    demand(0, "fmi3GetClock without an output clock");
    return fmi3Error;
}

EXPORT fmi3Status fmi3SetClock(fmi3Instance c, const fmi3ValueReference *vr, size_t n, const bool *values) {
    Bus *bus = c;
    demand(bus->mode == EVENT, "fmi3SetClock");
    for (size_t k = 0; k < n; k++) {
        Node *own = node(bus, vr[k]);
        if (vr[k] % 10 == TX_CLOCK) {
            demand(!own->tx_clock && fabs(bus->time - bus->end) < 1e-9, "a tick that was not asked for");
            own->tx_clock = values[k];
            if (bus->sender >= 0) {
                finish(bus);
                bus->end = bus->time;
            }
        } else {
            demand(vr[k] % 10 == RX_CLOCK && !own->rx_clock, "fmi3SetClock of another clock, or a second tick");
            own->rx_clock = values[k];
        }
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetIntervalDecimal(fmi3Instance c, const fmi3ValueReference *vr, size_t n, double *intervals,
                                         fmi3IntervalQualifier *qualifiers) {
    Bus *bus = c;
    for (size_t k = 0; k < n; k++) {
        demand(vr[k] % 10 == TX_CLOCK, "fmi3GetIntervalDecimal of another clock");
        Node *own = node(bus, vr[k]);
        intervals[k] = bus->end - bus->time;
        qualifiers[k] = own->changed ? fmi3IntervalChanged : fmi3IntervalNotYetKnown;
        own->changed = false;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference *vr, size_t n, size_t *sizes,
                                fmi3Binary *values, size_t m) {
    Bus *bus = c;
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        const Node *own = node(bus, vr[k]);
        demand(bus->mode == EVENT && vr[k] % 10 == TX_DATA && own->tx_clock, "a clocked variable without a tick");
        sizes[k] = own->tx_size;
        values[k] = own->tx;
    }
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference *vr, size_t n, const size_t *sizes,
                                const fmi3Binary *values, size_t m) {
    Bus *bus = c;
    demand(n == m, "numbers of values");
    for (size_t k = 0; k < n; k++) {
        Node *own = node(bus, vr[k]);
        demand(bus->mode == EVENT && vr[k] % 10 == RX_DATA && own->rx_clock, "a clocked variable without a tick");
        demand(sizes[k] >= HEAD && sizes[k] <= FRAME && own->count < WAITING, "one short frame");
        memcpy(own->waiting[own->count++], values[k], sizes[k]);
    }
    return fmi3OK;
}
