/* All problems of a body's parameters in one message: `name: expected <rule>, got <value>`, joined by "; ". */
#ifndef VIBROIMPACT_COMPLAINT_H
#define VIBROIMPACT_COMPLAINT_H

#include "motion/clock.h"

enum { VI_MESSAGE_LENGTH = 1024 }; /* bytes, with the end */

/* Add a problem to a message. Text beyond the message's length is cut and replaced by "...". */
void vi_complain(char message[VI_MESSAGE_LENGTH], const char *format, ...);

/* Complain unless the value is a finite number > 0; a finite number >= 0; a finite number. */
void vi_check_positive(char message[VI_MESSAGE_LENGTH], const char *name, double value);
void vi_check_not_negative(char message[VI_MESSAGE_LENGTH], const char *name, double value);
void vi_check_finite(char message[VI_MESSAGE_LENGTH], const char *name, double value);

/* Complain unless a forcing counted by this clock can go on at this angular frequency, rad/s, from `now`. */
void vi_check_retuning(char message[VI_MESSAGE_LENGTH], const vi_clock *clock, double angular_frequency,
                       vi_instant now);

typedef void (*vi_check)(char message[VI_MESSAGE_LENGTH], const char *name, double value);

/* Apply one check to name[1] to name[count]. */
void vi_check_each(char message[VI_MESSAGE_LENGTH], vi_check check, const char *name, const double values[],
                   int count);

/* Complain that time stands still at `time`, s, and name the contacts on their stops. */
void vi_complain_of_standstill(char message[VI_MESSAGE_LENGTH], double time, const int on_stop[], int count);

/* Complain of these contacts, whose stops leave bodies no room. */
void vi_complain_of_jam(char message[VI_MESSAGE_LENGTH], double time, const int jammed[], int count);

#endif
