/* The logger that FMUs call: formats the message and hands it to the receiver in Rust. */
#include <stdarg.h>
#include <stdio.h>

struct sink {
    void (*receive)(struct sink *sink, int status, const char *category, const char *text);
};

void master_logger(void *environment, const char *instance, int status, const char *category,
                   const char *message, ...) {
    struct sink *sink = environment;
    char text[4096];
    va_list arguments;
    (void)instance;
    if (sink == NULL || message == NULL) {
        return;
    }
    va_start(arguments, message);
    if (vsnprintf(text, sizeof text, message, arguments) < 0) {
        text[0] = '\0';
    }
    va_end(arguments);
    sink->receive(sink, status, category, text);
}
