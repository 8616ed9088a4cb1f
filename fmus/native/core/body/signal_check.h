/* Checks of the signals given to a component. */
#ifndef VIBROIMPACT_SIGNAL_CHECK_H
#define VIBROIMPACT_SIGNAL_CHECK_H

#include "body/complaint.h"
#include "signals/signal.h"

/* Complain of each member of a signal that breaks its rule; `name`, such as `signal[1]`, precedes the member's. */
void vi_check_signal(char message[VI_MESSAGE_LENGTH], const char *name, const vi_signal *signal);

#endif
