"""Published problems of contact, solved with error bars and held against what others print."""
