/* Misbehaviours that affect files and copies of the process. */
#define _GNU_SOURCE
#include "slave.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

/* Descriptors that a program that takes all of them for its own may use, and all that there can be. */
enum { FIRST = 3, LAST = 63, END = 1024 };

/* Whether a descriptor is that of the results file. */
static int is_results(int descriptor) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    ssize_t length = readlink(link, path, sizeof path - 1);
    path[length < 0 ? 0 : length] = '\0';
    return strstr(path, "/out/results.") != NULL;
}

static void act(const char *deed, int descriptor) {
    int failed = 0;
    if (strncmp(deed, "null over", 9) == 0) {
        int null = open("/dev/null", O_RDWR);
        failed = null < 0 || dup2(null, descriptor) < 0 || close(null);
    } else if (strncmp(deed, "write to", 8) == 0) {
        failed = write(descriptor, "word", 4) < 0;
    } else if (strncmp(deed, "truncate", 8) == 0) {
        failed = ftruncate(descriptor, 20) < 0;
    } else if (strncmp(deed, "rewind", 6) == 0) {
        failed = lseek(descriptor, 0, SEEK_SET) < 0;
    } else if (strncmp(deed, "overwrite", 9) == 0) {
        failed = lseek(descriptor, 0, SEEK_SET) < 0 || write(descriptor, "word", 4) < 0;
    } else if (strncmp(deed, "close", 5) == 0) {
        failed = close(descriptor);
    }
    /* Some descriptors are no files, and some are not open. */
    (void)failed;
}

/* "DEED descriptors" does it to each small descriptor, "DEED results" to that of the results. */
void meddle_with_files(const char *deed) {
    if (strstr(deed, " descriptors") != NULL) {
        for (int descriptor = FIRST; descriptor <= LAST; descriptor++) {
            act(deed, descriptor);
        }
    } else if (strstr(deed, " results") != NULL) {
        for (int descriptor = FIRST; descriptor < END; descriptor++) {
            if (is_results(descriptor)) {
                act(deed, descriptor);
            }
        }
    } else if (strcmp(deed, "delete the output") == 0) {
        if (system("rm -rf out") != 0) {
            abort();
        }
    } else if (strcmp(deed, "replace the output") == 0) {
        if (system("rm -rf out && mkdir out && echo word >out/results.csv") != 0) {
            abort();
        }
    }
}
