/* Writes the table of results.rs with fprintf: printf FILE COLUMNS PERIOD. Each line of its input
   is a number of rows; the answer is the processor time in ns that they took. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double processor_time(void) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return 1e9 * (double)now.tv_sec + (double)now.tv_nsec;
}

static int write_table(const char *path, const double *table, long rows, long columns, long period) {
    FILE *file = fopen(path, "w");
    if (!file) return 0;
    setvbuf(file, NULL, _IOFBF, 256 * 1024);
    fprintf(file, "\"time\"");
    for (long j = 0; j < columns; j++) fprintf(file, ",\"x%ld\"", j);
    fputc('\n', file);
    for (long k = 0; k < rows; k++) {
        const double *row = table + (k % period) * columns;
        fprintf(file, "%.17g", 1e-3 * (double)k);
        for (long j = 0; j < columns; j++) fprintf(file, ",%.17g", row[j]);
        fputc('\n', file);
    }
    return fclose(file) == 0;
}

int main(int count, char **arguments) {
    if (count != 4) return 2;
    long columns = atol(arguments[2]), period = atol(arguments[3]), rows;
    double *table = malloc(sizeof *table * (size_t)(columns * period));
    if (!table) return 2;
    for (long k = 0; k < period; k++)
        for (long j = 0; j < columns; j++)
            table[k * columns + j] = sin(0.001 * (double)k * ((double)j + 1.0));
    while (scanf("%ld", &rows) == 1) {
        double start = processor_time();
        if (!write_table(arguments[1], table, rows, columns, period)) return 1;
        printf("%.0f\n", processor_time() - start);
        fflush(stdout);
    }
    free(table);
    return 0;
}
