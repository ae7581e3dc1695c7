"""Lets every system call of a command fail once, and kills the command there, one after the other.

    just faults                 # all commands, every call: an hour
    just faults record bench    # two of them
    just faults --sample 50     # 50 faults of each, the same in every run

After each fault the command must have ended: with success, or with exit status 1 and a message. It must not
have panicked; files must be whole; and after `smaclite-pool clean` nothing of it may be left in shared memory
or in the folder of pools. Where the command serves others, they must get what is right, or an error. Where it
uses a pool that others use, they must not notice. Faults before `main` are not injected, because they are the
dynamic linker's. Needs strace.
"""
