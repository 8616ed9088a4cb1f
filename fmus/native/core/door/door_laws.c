#include "door/door_laws.h"

#include "contact/contact_law.h"
#include "door/door.h"

VI_DOOR int vi_door_most_laws(void)
{
    return VI_MOST_LAWS;
}

VI_DOOR const char *vi_door_law(int number, int *stop, int *external)
{
    const vi_law *law = vi_law_of(number);
    *stop = (int)law->stop;
    *external = law->external;
    return vi_contact_law_exists(number) ? law->name : NULL;
}
