/* The logger that FMUs call: formats the message and passes all arguments to the receiver in Rust.
 *
 * It does not dereference the environment and the names, which may be invalid pointers. */
#include <stdarg.h>
#include <stdio.h>

void master_receive(void *environment, const char *instance, int status, const char *category,
                    const char *text);

void master_logger(void *environment, const char *instance, int status, const char *category,
                   const char *message, ...) {
    char text[4096];
    va_list arguments;
    if (message == NULL) {
        return;
    }
    va_start(arguments, message);
    if (vsnprintf(text, sizeof text, message, arguments) < 0) {
        text[0] = '\0';
    }
    va_end(arguments);
    master_receive(environment, instance, status, category, text);
}
