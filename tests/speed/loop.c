/* The bare loop with which masters are compared: Jacobi's method for FMI 2.0 FMUs, and nothing else.
 *
 *     loop SYSTEM STEP STEPS [CSV]
 *
 * Each step it sets the connected inputs, steps and reads the outputs of one FMU after the other, one
 * call of fmi2SetReal, fmi2DoStep and fmi2GetReal each; between them it copies doubles. With CSV it
 * reads every Real output and prints all of them at every step, with "%.17g". Prints a JSON object: the
 * processor time in ns of the start and of one step, the peak memory in KiB, and the sum of the last
 * values.
 *
 * SYSTEM is a text file of words:
 *
 *     fmu LIBRARY GUID RESOURCES     number 0, 1, ... in this order
 *     set FMU REFERENCE VALUE        a Real, before initialisation
 *     boolean FMU REFERENCE VALUE    a Boolean, before initialisation
 *     output FMU REFERENCE NAME      an output, which is read each step; "record" instead of
 *     record FMU REFERENCE NAME      "output": only with CSV
 *     connect FMU REFERENCE FMU REFERENCE    output to input */
#define _POSIX_C_SOURCE 200809L
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define WORD 4096

typedef void *component;
typedef int status;
typedef const char *text;

struct callbacks {
    void (*logger)(void *, text, status, text, text, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, status);
    void *environment;
};

struct fmu {
    component component;
    status (*set_real)(component, const unsigned *, size_t, const double *);
    status (*do_step)(component, double, double, int);
    status (*get_real)(component, const unsigned *, size_t, double *);
    size_t inputs, outputs, first; /* counts; position of the first output among all values */
    unsigned *input, *output;      /* value references */
    size_t *source;                /* for each input the position of its value */
    double *set;
    text *names;
    void *library;
};

struct link {
    size_t from, to;
    unsigned from_reference, to_reference;
};

static struct fmu *fmus;
static struct link *links;
static size_t fmu_count, link_count, value_count;

static void fail(text what, text which)
{
    fprintf(stderr, "loop: %s %s\n", what, which);
    exit(1);
}

static void check(status status, text function)
{
    if (status > 1)
        fail("no fmi2OK from", function);
}

static void logger(void *environment, text name, status status, text category, text format, ...)
{
    va_list arguments;
    (void)environment, (void)category;
    if (status <= 1)
        return;
    fprintf(stderr, "%s: ", name);
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}

static const struct callbacks callbacks = {logger, calloc, free, NULL, NULL};

static double cpu(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

/* Peak memory in KiB on Linux, otherwise 0. (getrusage would include the parent's.) */
static long peak(void)
{
    char line[256];
    long found = 0;
    FILE *file = fopen("/proc/self/status", "r");
    while (file && fgets(line, sizeof line, file))
        if (strncmp(line, "VmHWM:", 6) == 0)
            found = strtol(line + 6, NULL, 10);
    if (file)
        fclose(file);
    return found;
}

static void *grown(void *array, size_t count, size_t size)
{
    if ((count & (count - 1)) != 0)
        return array;
    array = realloc(array, (count ? 2 * count : 1) * size);
    if (!array)
        fail("no memory for", "the system");
    return array;
}

/* The address of a function of the library. */
static void symbol(void *library, text name, void *function)
{
    void *found = dlsym(library, name);
    if (!found)
        fail("the library lacks", name);
    memcpy(function, &found, sizeof found);
}

static void word(FILE *file, char *into)
{
    if (fscanf(file, "%4095s", into) != 1)
        fail("the system ends", "too early");
}

static size_t number(FILE *file)
{
    char found[WORD];
    word(file, found);
    return strtoull(found, NULL, 10);
}

static struct fmu *which(FILE *file)
{
    size_t position = number(file);
    if (position >= fmu_count)
        fail("the system names an FMU", "that it does not have");
    return &fmus[position];
}

static void add_fmu(FILE *file)
{
    component (*instantiate)(text, int, text, text, const struct callbacks *, int, int);
    status (*setup)(component, int, double, double, int, double);
    char library[WORD], guid[WORD], resources[WORD], name[32];
    word(file, library), word(file, guid), word(file, resources);
    fmus = grown(fmus, fmu_count, sizeof *fmus);
    struct fmu *fmu = &fmus[fmu_count];
    memset(fmu, 0, sizeof *fmu);
    if (!(fmu->library = dlopen(library, RTLD_NOW | RTLD_LOCAL)))
        fail("cannot load", dlerror());
    symbol(fmu->library, "fmi2Instantiate", &instantiate);
    symbol(fmu->library, "fmi2SetupExperiment", &setup);
    symbol(fmu->library, "fmi2SetReal", &fmu->set_real);
    symbol(fmu->library, "fmi2DoStep", &fmu->do_step);
    symbol(fmu->library, "fmi2GetReal", &fmu->get_real);
    snprintf(name, sizeof name, "fmu%zu", fmu_count++);
    if (!(fmu->component = instantiate(name, 1, guid, resources, &callbacks, 0, 0)))
        fail("cannot instantiate", library);
    check(setup(fmu->component, 0, 0.0, 0.0, 0, 0.0), "fmi2SetupExperiment");
}

static void set(FILE *file)
{
    struct fmu *fmu = which(file);
    unsigned reference = (unsigned)number(file);
    char value[WORD];
    word(file, value);
    double real = strtod(value, NULL);
    check(fmu->set_real(fmu->component, &reference, 1, &real), "fmi2SetReal");
}

static void set_boolean(FILE *file)
{
    struct fmu *fmu = which(file);
    status (*set_boolean)(component, const unsigned *, size_t, const int *);
    unsigned reference = (unsigned)number(file);
    int value = (int)number(file);
    symbol(fmu->library, "fmi2SetBoolean", &set_boolean);
    check(set_boolean(fmu->component, &reference, 1, &value), "fmi2SetBoolean");
}

static void add_output(FILE *file, int read)
{
    struct fmu *fmu = which(file);
    unsigned reference = (unsigned)number(file);
    char name[WORD];
    word(file, name);
    if (!read)
        return;
    fmu->output = grown(fmu->output, fmu->outputs, sizeof *fmu->output);
    fmu->names = grown(fmu->names, fmu->outputs, sizeof *fmu->names);
    fmu->output[fmu->outputs] = reference;
    fmu->names[fmu->outputs++] = strdup(name);
}

static void add_link(FILE *file)
{
    links = grown(links, link_count, sizeof *links);
    struct link *link = &links[link_count++];
    link->from = (size_t)(which(file) - fmus), link->from_reference = (unsigned)number(file);
    link->to = (size_t)(which(file) - fmus), link->to_reference = (unsigned)number(file);
}

static void read_system(text path, int recording)
{
    char kind[WORD];
    FILE *file = fopen(path, "r");
    if (!file)
        fail("cannot read", path);
    while (fscanf(file, "%4095s", kind) == 1) {
        if (strcmp(kind, "fmu") == 0)
            add_fmu(file);
        else if (strcmp(kind, "set") == 0)
            set(file);
        else if (strcmp(kind, "boolean") == 0)
            set_boolean(file);
        else if (strcmp(kind, "output") == 0)
            add_output(file, 1);
        else if (strcmp(kind, "record") == 0)
            add_output(file, recording);
        else if (strcmp(kind, "connect") == 0)
            add_link(file);
        else
            fail("the system has an unknown word,", kind);
    }
    fclose(file);
}

/* Addresses of all values and, for each input, of the value connected to it. */
static void lay_out(void)
{
    for (size_t k = 0; k < fmu_count; k++) {
        fmus[k].first = value_count;
        value_count += fmus[k].outputs;
    }
    for (size_t k = 0; k < link_count; k++) {
        const struct fmu *from = &fmus[links[k].from];
        struct fmu *to = &fmus[links[k].to];
        size_t position = 0;
        while (position < from->outputs && from->output[position] != links[k].from_reference)
            position++;
        if (position == from->outputs)
            fail("a connection begins", "at what is no output");
        to->input = grown(to->input, to->inputs, sizeof *to->input);
        to->source = grown(to->source, to->inputs, sizeof *to->source);
        to->input[to->inputs] = links[k].to_reference;
        to->source[to->inputs++] = from->first + position;
    }
    for (size_t k = 0; k < fmu_count; k++)
        fmus[k].set = calloc(fmus[k].inputs + 1, sizeof(double));
}

static void write_inputs(struct fmu *fmu, const double *values)
{
    for (size_t k = 0; k < fmu->inputs; k++)
        fmu->set[k] = values[fmu->source[k]];
    if (fmu->inputs)
        check(fmu->set_real(fmu->component, fmu->input, fmu->inputs, fmu->set), "fmi2SetReal");
}

static void read_outputs(struct fmu *fmu, double *values)
{
    if (fmu->outputs)
        check(fmu->get_real(fmu->component, fmu->output, fmu->outputs, values + fmu->first),
              "fmi2GetReal");
}

static void for_all(text name)
{
    for (size_t k = 0; k < fmu_count; k++) {
        status (*function)(component);
        symbol(fmus[k].library, name, &function);
        check(function(fmus[k].component), name);
    }
}

/* Connected values are exchanged in initialization mode often enough to pass through all FMUs. */
static void initialise(double *values)
{
    for_all("fmi2EnterInitializationMode");
    for (size_t sweep = 0; sweep < (fmu_count < 3 ? fmu_count + 1 : 2); sweep++) {
        for (size_t k = 0; k < fmu_count; k++)
            read_outputs(&fmus[k], values);
        for (size_t k = 0; k < fmu_count; k++)
            write_inputs(&fmus[k], values);
    }
    for_all("fmi2ExitInitializationMode");
    for (size_t k = 0; k < fmu_count; k++)
        read_outputs(&fmus[k], values);
}

static void print_header(FILE *csv)
{
    fputs("time", csv);
    for (size_t k = 0; k < fmu_count; k++)
        for (size_t i = 0; i < fmus[k].outputs; i++)
            fprintf(csv, ",%s", fmus[k].names[i]);
    fputc('\n', csv);
}

static void print_row(FILE *csv, double time, const double *values)
{
    fprintf(csv, "%.17g", time);
    for (size_t k = 0; k < value_count; k++)
        fprintf(csv, ",%.17g", values[k]);
    fputc('\n', csv);
}

int main(int count, char **arguments)
{
    double begin = cpu();
    if (count != 4 && count != 5)
        fail("usage:", "loop SYSTEM STEP STEPS [CSV]");
    double step = strtod(arguments[2], NULL);
    unsigned long long steps = strtoull(arguments[3], NULL, 10);
    FILE *csv = count == 5 ? fopen(arguments[4], "w") : NULL;
    if (count == 5 && !csv)
        fail("cannot write", arguments[4]);
    read_system(arguments[1], csv != NULL);
    lay_out();
    /* Values at the begin of a step and at its end. */
    double *now = calloc(value_count + 1, sizeof *now), *next = calloc(value_count + 1, sizeof *next);
    initialise(now);
    if (csv)
        print_header(csv), print_row(csv, 0.0, now);
    double started = cpu();
    for (unsigned long long k = 0; k < steps; k++) {
        double time = (double)k * step;
        for (size_t i = 0; i < fmu_count; i++) {
            struct fmu *fmu = &fmus[i];
            write_inputs(fmu, now);
            check(fmu->do_step(fmu->component, time, step, 1), "fmi2DoStep");
            read_outputs(fmu, next);
        }
        double *last = now;
        now = next, next = last;
        if (csv)
            print_row(csv, (double)(k + 1) * step, now);
    }
    if (csv && fclose(csv))
        fail("cannot write", arguments[4]);
    double stepped = cpu(), sum = 0.0;
    for (size_t k = 0; k < value_count; k++)
        sum += now[k];
    printf("{\"start_ns\": %.0f, \"step_ns\": %.17g, \"peak_kib\": %ld, \"sum\": %.17g}\n",
           started - begin, (stepped - started) / (double)(steps ? steps : 1), peak(), sum);
    return 0;
}
