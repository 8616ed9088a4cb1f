#include "body/law_check.h"

#include <stdio.h>
#include <string.h>

/* Append a law to a list of laws; text beyond the room is cut. */
static void list(char *text, size_t size, int64_t law, const char *joint)
{
    const size_t used = strlen(text);
    (void)snprintf(text + used, size - used, "%s%lld (%s)", joint, (long long)law, vi_laws[law].name);
}

void vi_complain_of_law(char message[VI_MESSAGE_LENGTH], const char *name, const char *expected,
                        bool (*takes)(int64_t law), int64_t law)
{
    char known[VI_MESSAGE_LENGTH] = "";
    int64_t last = -1;
    for (int64_t other = 0; other < VI_MOST_LAWS; ++other) {
        if (!vi_contact_law_exists(other) || !takes(other)) {
            continue;
        }
        if (last >= 0) {
            list(known, sizeof known, last, known[0] == '\0' ? "" : ", ");
        }
        last = other;
    }
    list(known, sizeof known, last, known[0] == '\0' ? "" : " or ");
    vi_complain(message, "%s: expected %s%s, got %lld", name, expected, known, (long long)law);
}

void vi_check_law_rules(char message[VI_MESSAGE_LENGTH], const char *prefix, const vi_contact_law *law,
                        const vi_law_rule rules[])
{
    double value;
    for (const vi_law_rule *rule = rules; rule != NULL && rule->parameter != NULL; ++rule) {
        if (!vi_law_rule_holds(rule, law, &value)) {
            vi_complain(message, "%s%s: expected %s, got %.17g", prefix, rule->parameter, rule->expected, value);
        }
    }
}
