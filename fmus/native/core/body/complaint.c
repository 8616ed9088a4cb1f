#include "body/complaint.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "motion/clock.h"
#include "sizes.h"

/* Longest name of a variable with its index, in bytes. */
enum { NAME_LENGTH = 64 };

static void mark_as_cut(char message[VI_MESSAGE_LENGTH])
{
    static const char mark[] = "...";
    memcpy(message + VI_MESSAGE_LENGTH - sizeof mark, mark, sizeof mark);
}

void vi_complain(char message[VI_MESSAGE_LENGTH], const char *format, ...)
{
    size_t used = strlen(message);
    if (used + 3 >= VI_MESSAGE_LENGTH) {
        mark_as_cut(message);
        return;
    }
    if (used > 0) {
        memcpy(message + used, "; ", 3);
        used += 2;
    }
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(message + used, VI_MESSAGE_LENGTH - used, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= VI_MESSAGE_LENGTH - used) {
        mark_as_cut(message);
    }
}

void vi_check_positive(char message[VI_MESSAGE_LENGTH], const char *name, double value)
{
    if (!(value > 0.0) || !isfinite(value)) {
        vi_complain(message, "%s: expected a finite number > 0, got %.17g", name, value);
    }
}

void vi_check_not_negative(char message[VI_MESSAGE_LENGTH], const char *name, double value)
{
    if (!(value >= 0.0) || !isfinite(value)) {
        vi_complain(message, "%s: expected a finite number >= 0, got %.17g", name, value);
    }
}

void vi_check_finite(char message[VI_MESSAGE_LENGTH], const char *name, double value)
{
    if (!isfinite(value)) {
        vi_complain(message, "%s: expected a finite number, got %.17g", name, value);
    }
}

void vi_check_retuning(char message[VI_MESSAGE_LENGTH], const vi_clock *clock, double angular_frequency,
                       vi_instant now)
{
    if (!vi_clock_can_retune(clock, angular_frequency, now)) {
        vi_complain(message, "forcing.angular_frequency: expected %s, got %.17g",
                    clock->angular_frequency > 0.0 ? "another > 0, with a period that the time can be counted in"
                                                   : "0, for the force is constant since the start",
                    angular_frequency);
    }
}

void vi_check_each(char message[VI_MESSAGE_LENGTH], vi_check check, const char *name, const double values[],
                   int count)
{
    for (int i = 0; i < count; ++i) {
        char indexed[NAME_LENGTH];
        (void)snprintf(indexed, sizeof indexed, "%s[%d]", name, i + 1);
        check(message, indexed, values[i]);
    }
}

/* The names of the chosen contacts, at least one character. */
static void list_contacts(char names[16 * VI_PORTS], const int chosen[], int count)
{
    size_t used = 0;
    (void)snprintf(names, 16, "no contact");
    for (int k = 0; k < count; ++k) {
        if (chosen[k]) {
            used += (size_t)snprintf(names + used, 16 * VI_PORTS - used, "%scontact[%d]", used > 0 ? ", " : "", k + 1);
        }
    }
}

void vi_complain_of_standstill(char message[VI_MESSAGE_LENGTH], double time, const int on_stop[], int count)
{
    char names[16 * VI_PORTS];
    list_contacts(names, on_stop, count);
    vi_complain(message, "%s: expected a motion that goes on, got %d events at %.17g s. Change a gap, a start value or"
                         " contact_tolerance a little", names, VI_MOST_EVENTS, time);
}

void vi_complain_of_jam(char message[VI_MESSAGE_LENGTH], double time, const int jammed[], int count)
{
    char names[16 * VI_PORTS];
    list_contacts(names, jammed, count);
    vi_complain(message, "%s: expected room between their stops, of which one moves, got none at %.17g s", names, time);
}
