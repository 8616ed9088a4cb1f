/* Checks of the contact law given to a component. */
#ifndef VIBROIMPACT_LAW_CHECK_H
#define VIBROIMPACT_LAW_CHECK_H

#include "body/complaint.h"
#include "contact/contact_law.h"

/* Complain of a law's number, and list the laws that `takes` accepts: `expected 0 (none), ... or 7 (pair), got 9`. */
void vi_complain_of_law(char message[VI_MESSAGE_LENGTH], const char *name, const char *expected,
                        bool (*takes)(int64_t law), int64_t law);

/* Complain of each parameter that breaks its rule; `prefix`, such as `contact[1].`, precedes its name. */
void vi_check_law_rules(char message[VI_MESSAGE_LENGTH], const char *prefix, const vi_contact_law *law,
                        const vi_law_rule rules[]);

#endif
