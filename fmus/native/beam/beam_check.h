/* Checks of the parameters and inputs of a Beam. */
#ifndef VIBROIMPACT_BEAM_CHECK_H
#define VIBROIMPACT_BEAM_CHECK_H

#include "beam.h"

/* Complain of all parameters, also those of every body, and of the inputs. */
void beam_check(const beam *b, char message[VI_MESSAGE_LENGTH]);

/* Complain of the amplitude of the forcing, which is tunable; `self` is a beam. */
void beam_check_amplitude(const void *self, char message[VI_MESSAGE_LENGTH]);

/* Complain of the Beam's own inputs; `self` is a beam. */
void beam_check_inputs(const void *self, char message[VI_MESSAGE_LENGTH]);

#endif
